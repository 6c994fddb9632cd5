"""Sources of shapes, lights and backgrounds: built-in ones, or the user's folders.

Training and test never share a shape, nor a light unless that is asked for. Built-in shapes and
lights are seeded by split.
The files of a folder are split by a hash of their names, or by the subfolders `train` and `test`
if the folder has both.
"""

import hashlib
import os
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


def files(folder: Path, split: str, extensions: tuple[str, ...]) -> list[Path]:
    """Return the files of a folder that belong to a split, sorted by name.

    Raises:
        ValueError: if the folder or a split's is missing, or has too few files for two splits.
    """
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


@dataclass(frozen=True)
class ShapeSource:
    """The meshes of one split, by name.

    Args:
        folder: folder of mesh files, or None for built-in shapes.
        split: `train` or `test`.
        seed: seed of the corpus.
        usable: names of the folder's files that were found usable; None to list the folder.
        count: number of built-in shapes; None for `PROCEDURAL_SHAPES`.
    """

    folder: Path | None
    split: str
    seed: int
    usable: tuple[str, ...] | None = None
    count: int | None = None

    def names(self) -> list[str]:
        """Return the names of all shapes of the split, in a fixed order."""
        if self.usable is not None:
            return list(self.usable)
        if self.folder:
            return [path.name for path in files(self.folder, self.split, meshes.EXTENSIONS)]
        count = self.count or PROCEDURAL_SHAPES[self.split]
        return [f"{self.split}-{index:04d}" for index in range(count)]

    def load(self, name: str) -> meshes.Mesh:
        """Load or make the mesh of that name.

        Raises:
            ValueError: if the file of the mesh cannot be used.
        """
        if self.folder:
            return meshes.load(_find(self.folder, self.split, name))
        index = int(name.rsplit("-", 1)[1])
        return procedural.procedural(generator(self.seed, self.split, "shape", index))


@dataclass(frozen=True)
class LightSource:
    """The environment maps of one split, by name.

    Args:
        folder: folder of environment maps, or None for built-in ones.
        split: `train` or `test`.
        seed: seed of the corpus.
        cache: folder that keeps the maps of rendered rooms.
        usable: names of the folder's files that were found usable; None to list the folder.
        count: number of built-in rooms; None for `PROCEDURAL_ROOMS`.
        law: one of `LIGHT_LAWS`. Single maps are those of the folder, or rooms; mixed lights are
            made of all: the folder's maps, rooms and skies.
    """

    folder: Path | None
    split: str
    seed: int
    cache: Path
    usable: tuple[str, ...] | None = None
    count: int | None = None
    law: str = MAPS

    def names(self) -> list[str]:
        """Return the names of all maps of the split, in a fixed order."""
        own = self._files()
        if self.law == MAPS:
            return own or self.rooms()
        skies = [f"sky-{index:04d}" for index in range(SKIES)]
        return own + [name for name in [*self.rooms(), *skies] if name not in own]

    def rooms(self) -> list[str]:
        """Return the names of the built-in rooms that light the split; an empty list if none do."""
        if self.folder and self.law == MAPS:
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
        if self.folder and name in self._files():
            radiance = environments.load(_find(self.folder, self.split, name))
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

    def _files(self) -> list[str]:
        """Return the names of the folder's maps; an empty list without a folder."""
        if self.usable is not None:
            return list(self.usable)
        if self.folder:
            return [path.name for path in files(self.folder, self.split, environments.EXTENSIONS)]
        return []

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
        folder: folder of pictures, or None for random textures.
        usable: names of the folder's files that were found usable; None to list the folder.
    """

    folder: Path | None
    usable: tuple[str, ...] | None = None

    def pictures(self) -> list[Path]:
        """Return the user's pictures, sorted by name; an empty list without a folder.

        Raises:
            ValueError: if the folder is missing or holds no picture.
        """
        if not self.folder:
            return []
        if self.usable is not None:
            return [self.folder / name for name in self.usable]
        if not self.folder.is_dir():
            raise ValueError(f"{self.folder} is no folder: pass one with pictures")
        pictures = list_folder(self.folder, (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp"))
        if not pictures:
            raise ValueError(f"{self.folder} holds no picture (PNG, JPEG, TIFF or WebP)")
        return pictures

    def sample(self, rng: np.random.Generator, size: int) -> np.ndarray:
        """Draw a background `(size, size, 3)`, sRGB in [0, 1].

        Raises:
            ValueError: if the folder holds no picture, or a picture cannot be read.
        """
        pictures = self.pictures()
        if not pictures:
            return backgrounds.procedural(rng, size)
        return backgrounds.photograph(pictures[rng.integers(len(pictures))], rng, size)


_LARGEST_MAP = 512
"""Largest number of rows of a light; larger maps are averaged down, as they light no better."""


def _find(folder: Path, split: str, name: str) -> Path:
    """Return the path of a file in a folder, or in its subfolder for the split (see `files`)."""
    dealt = all((folder / name).is_dir() for name in SPLITS)
    return (folder / split if dealt else folder) / name
