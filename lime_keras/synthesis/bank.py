"""A bank on disk, `BANK/{geometry/*, lights/*, textures.npy, bank.json}`: manifest and textures.

`lime-render bank` writes it. The manifest is written last, so a bank that has one is complete.
"""

from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.io import untrusted

FORMAT, VERSION = "lime-bank", 1
MANIFEST, TEXTURES = "bank.json", "textures.npy"
LARGEST_SIZE = 1024
"""Largest height and width of a bank's G-buffers in pixels; four times the paper's."""
_KEYS = {"size": int, "count": int, "description": dict, "files": dict, "shapes": list}


def is_bank(folder: Path) -> bool:
    """Return whether a folder has the manifest of a bank."""
    return (folder / MANIFEST).is_file()


def manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest of a bank, and check that it is one that this version reads.

    Raises:
        FileNotFoundError: if the bank is incomplete.
        ValueError: if the manifest is broken or of another version.
    """
    path = folder / MANIFEST
    if not path.is_file():
        raise FileNotFoundError(
            f"{path} is missing: `lime-render bank {folder} --split SPLIT --count N` renders the "
            "bank, or completes it where it was interrupted"
        )
    try:
        held = untrusted.read_json(path)
    except ValueError as error:
        raise ValueError(
            f"{path} is broken ({error}): delete it and run the same `lime-render bank` again"
        ) from error
    if held.get("format") != FORMAT:
        raise ValueError(f"{path} is no manifest of a bank: pass a folder by `lime-render bank`")
    if held.get("version") != VERSION:
        raise ValueError(
            f"{path} is of version {held.get('version')}, and this lime-keras reads version "
            f"{VERSION}: render the bank anew, or install the lime-keras that it was made with"
        )
    wrong = [name for name, kind in _KEYS.items() if not isinstance(held.get(name), kind)]
    if not wrong and not all(isinstance(name, str) for name in held["shapes"]):
        wrong = ["names of shapes"]
    if wrong:
        raise ValueError(
            f"{path} has no {', '.join(wrong)}: delete it and run the same `lime-render bank` again"
        )
    if not 1 <= held["size"] <= LARGEST_SIZE:
        raise ValueError(
            f"{path} is of {held['size']} pixels, a bank has 1 to {LARGEST_SIZE}: render it anew"
        )
    return dict(held)


def file(folder: Path, name: str) -> Path:
    """Return the path of a file of a bank.

    Raises:
        FileNotFoundError: if there is no such file.
    """
    path = folder / name
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing: run the same `lime-render bank` command again")
    return path


def array(path: Path, mend: str) -> np.ndarray:
    """Map an array of a bank from disk.

    Args:
        path: a NumPy file.
        mend: what to do about a broken one, for the message.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: if the file is cut off or holds no array.
    """
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing: {mend}")
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except MemoryError:
        raise
    except Exception as error:  # NumPy evaluates the header, which may raise anything
        raise ValueError(f"{path} is cut off or broken ({error}): {mend}") from error


def textures(folder: Path) -> np.ndarray:
    """Return the textures of a bank, sRGB `(K, T, T, 3)` uint8, read as they are asked for.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: if the file is cut off or broken.
    """
    path = folder / TEXTURES
    mend = "delete it and run the same `lime-render bank` again"
    held = array(path, mend)
    square = held.ndim == 4 and held.shape[1:] == (held.shape[1], held.shape[1], 3)
    if held.dtype != np.uint8 or not square or not held.size:
        raise ValueError(f"{path} is {held.dtype} of {held.shape}, and no textures: {mend}")
    return held
