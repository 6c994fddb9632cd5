"""Sources of shapes, lights and backgrounds: built-in ones, or the user's folders.

Training and test never share a shape, nor a light unless that is asked for. Built-in shapes and
lights are seeded by split.
The files of a folder are split by a hash of their names, or by the subfolders `train` and `test`
if the folder has both.
"""

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lime_keras.data.corpus import SPLITS
from lime_keras.io import photo
from lime_keras.io.scanner import list_folder

from ..rooms import random_room
from ..shapes import meshes, procedural
from . import backgrounds, environments
from .lights import Light, prepare
from .quality import FAST, Quality

TEST_SHARE = 0.2
PROCEDURAL_SHAPES = {"train": 400, "test": 100}
PROCEDURAL_ROOMS = {"train": 40, "test": 12}
SKIES = 48  # number of skies, which mixed lights have beside rooms
LIGHT_LAWS = ("mixed", "maps")
"""Laws of the lights: mixtures of maps, rooms, skies and lamps (`light_law`); or single maps."""
MIXED, MAPS = LIGHT_LAWS
_SKY_ROWS = 512
_LARGEST_MAP = 512
"""Largest number of rows of a light; larger maps are averaged down, as they light no better."""
# Seeds hold the place of a kind: append, and never remove or reorder. `entry`, `order` and
# `texture` are no longer drawn.
_KINDS = {
    kind: number
    for number, kind in enumerate(
        ("example", "shape", "room", "shard", "entry", "body", "order", "sky", "texture", "light")
    )
}


def generator(seed: int, split: str, kind: str, *indices: int) -> np.random.Generator:
    """Return the random generator of one thing in a corpus, independent of all other generators.

    Args:
        seed: seed of the corpus.
        split: `train` or `test`.
        kind: kind of the thing: `example`, `shape`, `room`, `shard`, `body`, `sky` or `light`.
        indices: numbers of the thing, such as its index.
    """
    key = (SPLITS.index(split), _KINDS[kind], *indices)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def random_subset(rng: np.random.Generator, names: list[str], most: int) -> list[str]:
    """Return all names, or a random choice of `most` of them, in their order."""
    if len(names) <= most:
        return names
    return [names[k] for k in sorted(rng.choice(len(names), most, replace=False))]


def files(folder: Path | None, split: str, extensions: tuple[str, ...]) -> list[Path]:
    """Return the files of a folder that belong to a split, sorted by name; none without a folder.

    Raises:
        ValueError: if the folder or a split's is missing, or has too few files for two splits.
    """
    if folder is None:
        return []
    if not folder.is_dir():
        raise ValueError(f"{folder} is no folder: pass one with {', '.join(extensions)} files")
    dealt = {name: folder / name for name in SPLITS}
    if all(path.is_dir() for path in dealt.values()):
        listed = list_folder(dealt[split], extensions)
        if not listed:
            raise ValueError(f"{dealt[split]} holds no {', '.join(extensions)} file")
        return listed
    listed = list_folder(folder, extensions)
    lacking = [path for path in dealt.values() if not path.is_dir()]
    if not listed and len(lacking) == 1:
        raise ValueError(
            f"{lacking[0]} is missing: files are dealt to training and test by the folders "
            f"{' and '.join(SPLITS)}, or else all lie in {folder} itself"
        )
    if len(listed) < 2:
        raise ValueError(
            f"{folder} holds {len(listed)} {', '.join(extensions)} files; training and test share "
            "none, so at least 2 are needed"
        )
    ranked = sorted(listed, key=lambda path: hashlib.sha256(os.fsencode(path.name)).digest())
    tests = set(ranked[: max(1, round(len(ranked) * TEST_SHARE))])
    return [path for path in listed if (path in tests) == (split == "test")]


def pictures(folder: Path | None) -> list[Path]:
    """Return the pictures of a folder, sorted by name; none without a folder.

    Raises:
        ValueError: if the folder is missing or holds no picture.
    """
    if folder is None:
        return []
    if not folder.is_dir():
        raise ValueError(f"{folder} is no folder: pass one with pictures")
    listed = list_folder(folder, (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp"))
    if not listed:
        raise ValueError(f"{folder} holds no picture (PNG, JPEG, TIFF or WebP)")
    return listed


@dataclass(frozen=True)
class ShapeSource:
    """The meshes of one split, by name.

    Args:
        files: mesh files; none for built-in shapes.
        split: `train` or `test`.
        seed: seed of the corpus.
        count: number of built-in shapes; None for `PROCEDURAL_SHAPES`.
    """

    files: Sequence[Path]
    split: str
    seed: int
    count: int | None = None

    def names(self) -> list[str]:
        """Return the names of all shapes of the split, in a fixed order."""
        if self.files:
            return [path.name for path in self.files]
        count = self.count or PROCEDURAL_SHAPES[self.split]
        return [f"{self.split}-{index:04d}" for index in range(count)]

    def load(self, name: str) -> meshes.Mesh:
        """Load or make the mesh of that name.

        Raises:
            ValueError: if the file of the mesh cannot be used.
        """
        if self.files:
            return meshes.load(_named(self.files)[name])
        index = int(name.rsplit("-", 1)[1])
        return procedural.procedural(generator(self.seed, self.split, "shape", index))


@dataclass(frozen=True)
class LightSource:
    """The environment maps of one split, by name.

    Args:
        files: environment maps; none for built-in ones.
        split: `train` or `test`.
        seed: seed of the corpus.
        cache: folder that keeps the maps of rendered rooms.
        count: number of built-in rooms; None for `PROCEDURAL_ROOMS`.
        law: one of `LIGHT_LAWS`. Single maps are the files, or rooms; mixed lights are made of all:
            files, rooms and skies.
    """

    files: Sequence[Path]
    split: str
    seed: int
    cache: Path
    count: int | None = None
    law: str = MAPS

    def names(self) -> list[str]:
        """Return the names of all maps of the split, in a fixed order."""
        own = [path.name for path in self.files]
        if self.law == MAPS:
            return own or self.rooms()
        skies = [f"sky-{index:04d}" for index in range(SKIES)]
        return own + [name for name in [*self.rooms(), *skies] if name not in own]

    def rooms(self) -> list[str]:
        """Return the names of the built-in rooms that light the split; an empty list if none do."""
        if self.files and self.law == MAPS:
            return []
        count = self.count or PROCEDURAL_ROOMS[self.split]
        return [f"room-{index:04d}.exr" for index in range(count)]

    def load(self, name: str, quality: Quality = FAST) -> Light:
        """Load the map of that name and prepare it as a light; a missing room is rendered first.

        Raises:
            ValueError: if the file of the map cannot be used.
        """
        return prepare(name, self.radiance(name), quality=quality)

    def radiance(self, name: str) -> np.ndarray:
        """Return the radiance `(H, W)` of the map of that name, H at most 512; see `load`."""
        if path := _named(self.files).get(name):
            radiance = environments.load(path)
        elif name.startswith("sky-"):
            # `skies` imports Mitsuba, which must wait until `variants.activate` chose its library.
            from . import skies

            index = int(name.removeprefix("sky-"))
            return skies.sample(generator(self.seed, self.split, "sky", index), _SKY_ROWS)
        else:
            path = self.cache / name
            if not path.is_file():
                self.render_room(name)
            radiance = environments.load(path)
        if len(radiance) > _LARGEST_MAP:
            height = min(_LARGEST_MAP, radiance.shape[1] // 2)
            radiance = environments.resized(radiance, height)
        return radiance

    def render_room(self, name: str) -> None:
        """Render one built-in room into the cache; Mitsuba's variant must be set before."""
        # `renderer` imports Mitsuba, which must wait until `variants.activate` chose its library.
        from ..rooms import renderer

        index = int(name.removeprefix("room-").removesuffix(".exr"))
        rng = generator(self.seed, self.split, "room", index)
        radiance = renderer.render(random_room.sample(rng), seed=int(rng.integers(2**31)))
        photo.write(self.cache / name, np.minimum(radiance, 65504)[..., None], shared=True)


@dataclass(frozen=True)
class BackgroundSource:
    """The backgrounds of a corpus: random textures, or crops of the user's pictures.

    Args:
        files: pictures; none for random textures.
    """

    files: Sequence[Path]

    def sample(self, rng: np.random.Generator, size: int) -> np.ndarray:
        """Draw a background `(size, size, 3)`, sRGB in [0, 1].

        Raises:
            ValueError: if a picture cannot be read.
        """
        if not self.files:
            return backgrounds.procedural(rng, size)
        return backgrounds.photograph(self.files[int(rng.integers(len(self.files)))], rng, size)


def _named(paths: Sequence[Path]) -> dict[str, Path]:
    return {path.name: path for path in paths}
