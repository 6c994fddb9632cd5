"""The description of a split, on which the split's bytes depend, and the job of rendering it."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lime_keras.data.corpus import Split
from lime_keras.optics.material_law import UNIFORM

from ..mitsuba_setup import variants
from ..scene import environments
from ..shapes import procedural
from . import inputs, sources


@dataclasses.dataclass(frozen=True)
class Description:
    """A description of a split: everything that its bytes depend on, apart from the software.

    Attributes:
        split: `train` or `test`.
        count: number of examples.
        seed: seed of everything random; 0 is a valid seed.
        size: height and width of the images in pixels.
        shard_size: number of examples in a shard.
        quality: name of the quality (see `QUALITIES`).
        shading: `furnace` or `literal`.
        shapes: folder of meshes, or None for the built-in shapes.
        environments: folder of environment maps, or None for the built-in rooms.
        backgrounds: folder of pictures, or None for random textures.
        variant: variant of Mitsuba.
        materials: name of the law of the materials (see `material_law.LAWS`).
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
    materials: str = UNIFORM

    @property
    def shards(self) -> int:
        """The number of shards."""
        return -(-self.count // self.shard_size)

    def indices(self, shard: int) -> range:
        """Return the indices of the examples in a shard."""
        first = shard * self.shard_size
        return range(first, min(first + self.shard_size, self.count))


@dataclasses.dataclass(frozen=True)
class Job:
    """The job of rendering a split, as a worker needs it.

    Attributes:
        out: folder of the corpus.
        description: description of the split.
        choice: variant and library of Mitsuba.
        usable: names of the user's files to use, by kind; None if the folder is to be listed, or if
            the kind is built in.
    """

    out: Path
    description: Description
    choice: variants.Choice
    usable: Mapping[str, tuple[str, ...] | None] = dataclasses.field(
        default_factory=lambda: dict.fromkeys(inputs.KINDS)
    )

    def recorded(self) -> dict[str, Any]:
        """Return the description as it is stored in JSON; see `recorded`."""
        return recorded(self.description)

    def files(self) -> dict[str, list[Path]]:
        """Return the user's files for this split, by kind; see `files`."""
        return files(self.description)

    @property
    def split(self) -> Split:
        """The split on disk that the job writes."""
        return Split(self.out, self.description.split)

    @property
    def shapes(self) -> sources.ShapeSource:
        """The source of the split's shapes."""
        description = self.description
        return sources.ShapeSource(
            self._folder("shapes"), description.split, description.seed, self.usable["shapes"]
        )

    @property
    def lights(self) -> sources.LightSource:
        """The source of the split's lights."""
        return sources.LightSource(
            self._folder("environments"),
            self.description.split,
            self.description.seed,
            self.split.folder / "rooms",
            self.usable["environments"],
        )

    @property
    def backgrounds(self) -> sources.BackgroundSource:
        """The source of the split's backgrounds."""
        return sources.BackgroundSource(self._folder("backgrounds"), self.usable["backgrounds"])

    def _folder(self, kind: str) -> Path | None:
        folder = getattr(self.description, kind)
        return Path(folder) if folder else None


def recorded(description: Any) -> dict[str, Any]:
    """Return a description, a dataclass, as it is stored in JSON.

    Folders are stored by name alone: their place on this machine changes no byte.

    Args:
        description: a dataclass, among whose fields are the folders of `inputs.KINDS`.
    """
    record = dataclasses.asdict(description)
    for name in inputs.KINDS:
        record[name] = Path(record[name]).name if record[name] else None
    return record


def files(description: Any) -> dict[str, list[Path]]:
    """Return the user's files for a split, by kind; an empty list for a built-in kind.

    Args:
        description: a dataclass, among whose fields are `split` and the folders of `inputs.KINDS`.

    Raises:
        ValueError: if a folder is missing or holds too few files.
    """
    folders = {kind: getattr(description, kind) for kind in inputs.KINDS}
    extensions = {"shapes": procedural.EXTENSIONS, "environments": environments.EXTENSIONS}
    found = {
        kind: sources.files(Path(folders[kind]), description.split, known) if folders[kind] else []
        for kind, known in extensions.items()
    }
    pictures = folders["backgrounds"]
    source = sources.BackgroundSource(Path(pictures) if pictures else None)
    return found | {"backgrounds": source.pictures()}
