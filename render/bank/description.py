"""The description of a bank, on which the bank's bytes depend, and the job of rendering it."""

import dataclasses
from pathlib import Path
from typing import Any

from lime_keras.synthesis import bank

from ..jobs import description as base
from ..scene import sources

SKIES = {"train": 48, "test": 12}
"""Number of skies of each split."""


@dataclasses.dataclass(frozen=True)
class Description(base.Description):
    """A description of a bank: everything that its bytes depend on, apart from the software.

    Attributes:
        shapes: folder of meshes, half of the entries; or None for procedural shapes alone.
        environments: folder of environment maps, or None for rooms and skies alone.
        backgrounds: folder of pictures, or None for random textures.
        variant: variant of Mitsuba.
    """

    shapes: str | None
    environments: str | None
    backgrounds: str | None
    variant: str


@dataclasses.dataclass(frozen=True)
class Job(base.Job):
    """The job of rendering a bank, as a worker needs it."""

    kind, manifest = "bank", bank.MANIFEST
    description: Description

    def recorded(self) -> dict[str, Any]:
        """Return the description as it is stored in JSON, with the version of the format."""
        return {"format": bank.FORMAT, "version": bank.VERSION} | super().recorded()

    def shard_files(self, shard: int) -> tuple[Path, ...]:
        """Return the paths of a shard's G-buffers, of their index and of their sidecar."""
        path = self.out / "geometry" / f"{shard:05d}.bin"
        return path, path.with_suffix(".npy"), path.with_suffix(".json")

    @property
    def parts(self) -> Path:
        """The folder of the parts of lights and textures, while not all are rendered."""
        return self.out / "parts"

    def light_part(self, number: int) -> Path:
        """Return the path of a light, until all are put together."""
        return self.parts / f"light-{number:05d}.npz"

    def texture_part(self, number: int) -> Path:
        """Return the path of some textures, until all are put together."""
        return self.parts / f"textures-{number:05d}.npy"

    @property
    def shapes(self) -> sources.ShapeSource | None:
        """The source of the user's meshes; None for procedural shapes alone."""
        folder, given = self.description.folder("shapes"), self.description
        if folder is None:
            return None
        return sources.ShapeSource(folder, given.split, given.seed, self.usable["shapes"])

    def light_source(self, kind: str) -> sources.LightSource:
        """Return the source of the lights of a kind: `photograph`, the user's maps, or `room`."""
        folder = self.description.folder("environments") if kind == "photograph" else None
        return sources.LightSource(
            folder,
            self.description.split,
            self.description.seed,
            self.parts / "rooms",
            self.usable["environments"] if folder else None,
        )

    def light_names(self) -> list[tuple[str, str]]:
        """Return kind and name of every light, in the order of the bank."""
        skies = [f"sky-{index:04d}" for index in range(SKIES[self.description.split])]
        named = {"room": self.light_source("room").names(), "sky": skies}
        if self.description.environments:
            named = {"photograph": self.light_source("photograph").names()} | named
        return [(kind, name) for kind, names in named.items() for name in names]
