"""The description of a split, on which the split's bytes depend, and the job of rendering it."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from lime_keras.data.corpus import Split
from lime_keras.optics.material_law import UNIFORM

from ..mitsuba_setup import variants
from ..scene import environments, sources
from ..shapes import meshes
from . import inputs

_LEFT_OUT = {"light_law": sources.MAPS, "endless": 0.0}
"""Options that corpora of before did not have, each left out of JSON where it changes nothing."""


@dataclasses.dataclass(frozen=True)
class Description:
    """A description of a split: everything that its bytes depend on, apart from the software.

    Attributes:
        split: `train` or `test`.
        count: number of examples.
        seed: seed of everything random; 0 is a valid seed.
        size: height and width in pixels.
        shard_size: number of examples in a shard.
        quality: name of the quality (see `QUALITIES`).
        shading: the lobe of S, one of `corpus.LOBES`.
        shapes: folder of meshes, or None for the built-in shapes.
        environments: folder of environment maps, or None for the built-in rooms.
        backgrounds: folder of pictures, or None for random textures.
        variant: variant of Mitsuba.
        materials: name of the law of the materials (see `material_law.LAWS`).
        light_split: split whose lights are used, where it is not this one: `train`, for a test
            split of unseen shapes under known lights.
        shape_count: number of built-in shapes; None for that of `sources`.
        light_count: number of built-in rooms; None for that of `sources`.
        light_law: name of the law of the lights (see `sources.LIGHT_LAWS`).
        endless: share of the bodies that no other shard has (see `corpus.random_example`).
    """

    split: str
    count: int
    seed: int
    size: int
    shard_size: int
    quality: str
    shading: str = dataclasses.field(default="furnace", kw_only=True)
    shapes: str | None
    environments: str | None
    backgrounds: str | None
    variant: str
    materials: str = UNIFORM
    light_split: str | None = None
    shape_count: int | None = None
    light_count: int | None = None
    light_law: str = sources.MAPS
    endless: float = 0.0

    @property
    def shards(self) -> int:
        """The number of shards."""
        return -(-self.count // self.shard_size)

    def indices(self, shard: int) -> range:
        """Return the indices of what is in a shard."""
        first = shard * self.shard_size
        return range(first, min(first + self.shard_size, self.count))

    def folder(self, kind: str) -> Path | None:
        """Return the user's folder of a kind of `inputs.KINDS`; None for the built-in kind."""
        folder = getattr(self, kind)
        return Path(folder) if folder else None

    def recorded(self) -> dict[str, Any]:
        """Return the description as it is stored in JSON; a built-in kind has no entry.

        Folders are stored by name alone: their place on this machine changes no byte.
        """
        record = dataclasses.asdict(self)
        for kind in inputs.KINDS:
            folder = self.folder(kind)
            record[kind] = folder.name if folder else None
        return {
            name: value
            for name, value in record.items()
            if value is not None and (name not in _LEFT_OUT or value != _LEFT_OUT[name])
        }

    def files(self) -> dict[str, list[Path]]:
        """Return the user's files for the split, by kind; an empty list for a built-in kind.

        Raises:
            ValueError: if a folder is missing or holds too few files.
        """
        shapes, maps = self.folder("shapes"), self.folder("environments")
        lights = self.light_split or self.split
        return {
            "shapes": sources.files(shapes, self.split, meshes.EXTENSIONS),
            "environments": sources.files(maps, lights, environments.EXTENSIONS),
            "backgrounds": sources.pictures(self.folder("backgrounds")),
        }


@dataclasses.dataclass(frozen=True)
class Job:
    """The job of rendering a split, as a worker needs it.

    Attributes:
        out: folder of the corpus.
        description: description of the split.
        choice: variant and library of Mitsuba.
        usable: the user's files to use, by kind; none of a kind that is built in.
    """

    out: Path
    description: Description
    choice: variants.Choice
    usable: Mapping[str, Sequence[Path]] = dataclasses.field(
        default_factory=lambda: dict.fromkeys(inputs.KINDS, ())
    )

    @property
    def split(self) -> Split:
        """The split on disk that the job writes: the folder that it claims."""
        return Split(self.out, self.description.split)

    def missing(self, shards: Iterable[int]) -> list[int]:
        """Return those of some shards of which a file is missing."""
        paths = self.split.shard_path, self.split.sidecar_path
        return [shard for shard in shards if not all(path(shard).is_file() for path in paths)]
