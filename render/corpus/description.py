"""What a split is to be: everything that its bytes depend on, and where to write it."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lime_keras.data.corpus import Split

from ..mitsuba_setup import variants
from ..scene import environments
from ..shapes import procedural
from . import inputs, sources


@dataclasses.dataclass(frozen=True)
class Description:
    """Everything that a split's bytes depend on, apart from the software.

    Attributes:
        split: `train` or `test`.
        count: number of examples.
        seed: of everything random; 0 is a seed.
        size: height and width of the images in pixels.
        shard_size: examples in a shard.
        quality: name of one of `QUALITIES`.
        shading: `furnace` or `literal`.
        shapes: folder of meshes, or None for the built-in ones.
        environments: folder of maps, or None for the built-in rooms.
        backgrounds: folder of pictures, or None for random textures.
        variant: Mitsuba's.
    """

    split: str
    count: int
    seed: int
    size: int
    shard_size: int
    quality: str
    shading: str
    shapes: str | None
    environments: str | None
    backgrounds: str | None
    variant: str

    @property
    def shards(self) -> int:
        """Number of shards."""
        return -(-self.count // self.shard_size)

    def indices(self, shard: int) -> range:
        """Indices of the examples in a shard."""
        first = shard * self.shard_size
        return range(first, min(first + self.shard_size, self.count))


@dataclasses.dataclass(frozen=True)
class Job:
    """What a worker needs to know.

    Attributes:
        out: folder of the corpus.
        description: of the split.
        choice: Mitsuba's variant and library.
        usable: names of the user's files to use, by kind; None to list them, or where something
            built in serves.
    """

    out: Path
    description: Description
    choice: variants.Choice
    usable: Mapping[str, tuple[str, ...] | None] = dataclasses.field(
        default_factory=lambda: dict.fromkeys(inputs.KINDS)
    )

    def recorded(self) -> dict[str, Any]:
        """The description as it is written down.

        Folders are told by name: where they lie on this machine changes no byte.
        """
        record = dataclasses.asdict(self.description)
        for name in inputs.KINDS:
            record[name] = Path(record[name]).name if record[name] else None
        return record

    def files(self) -> dict[str, list[Path]]:
        """The user's files for this split, by kind; none where something built in serves."""
        extensions = {"shapes": procedural.EXTENSIONS, "environments": environments.EXTENSIONS}
        found = {
            kind: sources.files(folder, self.description.split, extensions[kind]) if folder else []
            for kind in extensions
            for folder in [self._folder(kind)]
        }
        backgrounds = sources.BackgroundSource(self._folder("backgrounds"))
        return found | {"backgrounds": backgrounds.pictures()}

    @property
    def split(self) -> Split:
        """Where the split is written."""
        return Split(self.out, self.description.split)

    @property
    def shapes(self) -> sources.ShapeSource:
        """Where its shapes come from."""
        description = self.description
        return sources.ShapeSource(
            self._folder("shapes"), description.split, description.seed, self.usable["shapes"]
        )

    @property
    def lights(self) -> sources.LightSource:
        """Where its lights come from."""
        return sources.LightSource(
            self._folder("environments"),
            self.description.split,
            self.description.seed,
            self.split.folder / "rooms",
            self.usable["environments"],
        )

    @property
    def backgrounds(self) -> sources.BackgroundSource:
        """Where its backgrounds come from."""
        return sources.BackgroundSource(self._folder("backgrounds"), self.usable["backgrounds"])

    def _folder(self, kind: str) -> Path | None:
        folder = getattr(self.description, kind)
        return Path(folder) if folder else None
