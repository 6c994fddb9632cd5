"""The description of a bank, on which the bank's bytes depend, and the job of rendering it."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lime_keras.synthesis import bank

from ..corpus import description as corpus_description
from ..corpus import inputs, sources
from ..mitsuba_setup import variants

SKIES = {"train": 48, "test": 12}
"""Number of skies of each split."""


@dataclasses.dataclass(frozen=True)
class Description:
    """A description of a bank: everything that its bytes depend on, apart from the software.

    Attributes:
        split: `train` or `test`.
        count: number of entries.
        seed: seed of everything random; 0 is a valid seed.
        size: height and width of the G-buffers in pixels.
        shard_size: number of entries in a shard.
        shapes: folder of meshes, half of the entries; or None for procedural shapes alone.
        environments: folder of environment maps, or None for rooms and skies alone.
        backgrounds: folder of pictures, or None for random textures.
        variant: variant of Mitsuba.
    """

    split: str
    count: int
    seed: int
    size: int
    shard_size: int
    shapes: str | None
    environments: str | None
    backgrounds: str | None
    variant: str

    @property
    def shards(self) -> int:
        """The number of shards."""
        return -(-self.count // self.shard_size)

    def indices(self, shard: int) -> range:
        """Return the indices of the entries in a shard."""
        first = shard * self.shard_size
        return range(first, min(first + self.shard_size, self.count))


@dataclasses.dataclass(frozen=True)
class Job:
    """The job of rendering a bank, as a worker needs it.

    Attributes:
        out: folder of the bank.
        description: description of the bank.
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
        """Return the description as it is stored in JSON, with the version of the format."""
        recorded = corpus_description.recorded(self.description)
        return {"format": bank.FORMAT, "version": bank.VERSION} | recorded

    def files(self) -> dict[str, list[Path]]:
        """Return the user's files for this split, by kind; an empty list for a built-in kind."""
        return corpus_description.files(self.description)

    @property
    def description_path(self) -> Path:
        """The file that records the bank's settings; written before anything is rendered."""
        return self.out / "description.json"

    @property
    def inputs_path(self) -> Path:
        """The file that records what was found in the user's files."""
        return self.out / "inputs.json"

    @property
    def parts(self) -> Path:
        """The folder of the parts of lights and textures, while not all are rendered."""
        return self.out / "parts"

    def shard_path(self, shard: int) -> Path:
        """Return the path of a shard's G-buffers; its index and its sidecar lie beside it."""
        return self.out / "geometry" / f"{shard:05d}.bin"

    def light_part(self, number: int) -> Path:
        """Return the path of a light, until all are put together."""
        return self.parts / f"light-{number:05d}.npz"

    def texture_part(self, number: int) -> Path:
        """Return the path of some textures, until all are put together."""
        return self.parts / f"textures-{number:05d}.npy"

    @property
    def shapes(self) -> sources.ShapeSource | None:
        """The source of the user's meshes; None for procedural shapes alone."""
        folder = self.description.shapes
        if not folder:
            return None
        description = self.description
        return sources.ShapeSource(
            Path(folder), description.split, description.seed, self.usable["shapes"]
        )

    @property
    def backgrounds(self) -> sources.BackgroundSource:
        """The source of the textures."""
        folder = self.description.backgrounds
        return sources.BackgroundSource(
            Path(folder) if folder else None, self.usable["backgrounds"]
        )

    def light_source(self, kind: str) -> sources.LightSource:
        """Return the source of the lights of a kind: `photograph`, the user's maps, or `room`."""
        folder = self.description.environments if kind == "photograph" else None
        return sources.LightSource(
            Path(folder) if folder else None,
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
