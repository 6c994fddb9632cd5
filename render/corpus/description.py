"""The description of a split, on which the split's bytes depend, and the job of rendering it."""

import dataclasses
from pathlib import Path
from typing import Any

from lime_keras.data.corpus import Split
from lime_keras.optics.material_law import UNIFORM

from ..jobs import description as base
from ..scene import sources


@dataclasses.dataclass(frozen=True)
class Description(base.Description):
    """A description of a split: everything that its bytes depend on, apart from the software.

    Attributes:
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
        endless: share of the bodies that no other shard has (see `bodies`).
    """

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

    def split_of(self, kind: str) -> str:
        """Return the split whose files of a kind of `inputs.KINDS` are used."""
        return self.light_split or self.split if kind == "environments" else self.split


@dataclasses.dataclass(frozen=True)
class Job(base.Job):
    """The job of rendering a split, as a worker needs it."""

    kind, manifest = "split", "manifest.json"
    description: Description

    @property
    def split(self) -> Split:
        """The split on disk that the job writes."""
        return Split(self.out, self.description.split)

    @property
    def folder(self) -> Path:
        """The folder of the split."""
        return self.split.folder

    def shard_files(self, shard: int) -> tuple[Path, ...]:
        """Return the path of a shard's records, and that of its sidecar."""
        return self.split.shard_path(shard), self.split.sidecar_path(shard)

    def recorded(self) -> dict[str, Any]:
        """Return the description as it is stored in JSON.

        A built-in kind has no entry, and neither has an option that corpora of before did not have,
        where it changes nothing.
        """
        left_out = {"light_law": sources.MAPS, "endless": 0.0}
        return {
            name: value
            for name, value in super().recorded().items()
            if value is not None and (name not in left_out or value != left_out[name])
        }

    @property
    def shapes(self) -> sources.ShapeSource:
        """The source of the split's shapes."""
        given = self.description
        return sources.ShapeSource(
            given.folder("shapes"),
            given.split,
            given.seed,
            self.usable["shapes"],
            given.shape_count,
        )

    @property
    def lights(self) -> sources.LightSource:
        """The source of the split's lights."""
        given = self.description
        return sources.LightSource(
            given.folder("environments"),
            given.split_of("environments"),
            given.seed,
            self.folder / "rooms",
            self.usable["environments"],
            given.light_count,
            given.light_law,
        )
