"""Where the things of a split come from: random generators of its own, and the user's folders.

Training and test never share a shape, nor a light unless that is asked for. The files of a folder
are split by a hash of their names, or by the subfolders `train` and `test` if the folder has both.
"""

import hashlib
import os
from collections import Counter
from pathlib import Path

import numpy as np

from lime_keras.data.corpus import SPLITS
from lime_keras.io.scanner import list_folder

TEST_SHARE = 0.2
ROOMS = {"train": 40, "test": 12}  # built-in rooms, if no other number is asked for
LIGHT_LAWS = ("mixed", "maps")
"""Laws of the lights: mixtures of maps, rooms, skies and lamps (`light_law`); or single maps."""
MIXED, MAPS = LIGHT_LAWS
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
    stems = Counter(path.stem.casefold() for path in listed)
    if stem := next((stem for stem, number in stems.items() if number > 1), None):
        alike = [path.name for path in listed if path.stem.casefold() == stem]
        raise ValueError(
            f"{folder}: {' and '.join(alike)} may be one thing, which training and test would "
            f"share: keep one, or deal them to folders {' and '.join(SPLITS)}"
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
