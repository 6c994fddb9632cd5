"""Rows of features in memory-mapped files: written once, in any order, and read in any order.

A folder holds `NAME.npy` for each column, `made.npy`, and `photos.json`, which is written when all
rows are there. Pictures, masks and layers have 8 bits, and marks of pixels 1.
"""

import json
import math
import os
import shutil
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lime_keras.io import atomic, untrusted
from lime_keras.optics.dynamic_range import compress
from lime_keras.optics.environment import STORED_SHAPE

PART = 128  # number of rows that are made at once, and lost if the making is interrupted
INPUT_MASK = "seen_mask"
"""Feature: the mask that the object is cut out with; losses and measures take the true one."""
PREDICTED = "predicted_"
"""Prefix of the features that frozen subnetworks predicted, compressed by log(1 + x)."""

FORMAT = 3
"""Number of the form of the files; files of another form are made anew, in another folder."""

_RECORD = "photos.json"
_RESERVE = 2**28  # bytes that stay free on the disk for checkpoints and models
_ENDS = 8  # bytes before a layer's levels: the values of the lowest and the highest, float32

_BYTES = {"image": 3, "mask": 1, INPUT_MASK: 1}
_BITS = {"clipped": 3, "painted": 1}
_LAYERS = ("diffuse_shading", "specular_shading", "mirror")
_NUMBERS: Mapping[str, tuple[tuple[int, ...], Any]] = {
    "diffuse_albedo": ((3,), np.float32),
    "cast": ((4,), np.float32),
    **dict.fromkeys(("specular_albedo", "ambient", "shininess"), ((), np.float32)),
    "exponent_bin": ((), np.int32),
    **dict.fromkeys(("seed", "index"), ((), np.int64)),
}


class Column(NamedTuple):
    """How a feature of one row is kept.

    Attributes:
        shape: shape of the feature, without the rows.
        dtype: type of the numbers in the file.
        is_packed: whether the file holds eight marks a byte.
    """

    shape: tuple[int, ...]
    dtype: Any
    is_packed: bool = False

    @property
    def kept_shape(self) -> tuple[int, ...]:
        """The shape of a row in the file."""
        return (-(-math.prod(self.shape) // 8),) if self.is_packed else self.shape

    def encode(self, values: np.ndarray) -> np.ndarray:
        """Return rows of the feature as the file holds them."""
        if self.is_packed:
            return np.packbits(np.reshape(values, (len(values), -1)) > 0, axis=1)
        if self.dtype == np.uint8:
            return np.round(np.asarray(values, np.float32) * 255).astype(np.uint8)
        return np.asarray(values, self.dtype)

    def decode(self, kept: np.ndarray) -> np.ndarray:
        """Return rows of the feature as networks and losses take them; floats are float32."""
        if self.is_packed:
            bits = np.unpackbits(kept, axis=1, count=math.prod(self.shape))
            return bits.reshape(-1, *self.shape).astype(np.float32)
        if self.dtype == np.uint8:
            return kept * np.float32(1 / 255)
        return np.asarray(kept)


class LayerColumn(NamedTuple):
    """How a layer is kept: in 256 levels from its least value to its largest.

    Attributes:
        shape: shape of the layer, without the rows.
        is_linear: whether the layer is linear radiance x. Then the levels are those of
            √log(1 + x): networks read the logarithm, and the root keeps what is dark apart. Else
            they are even.
    """

    shape: tuple[int, ...]
    is_linear: bool
    dtype: Any = np.uint8

    @property
    def kept_shape(self) -> tuple[int, ...]:
        """The shape of a row in the file: both ends of the levels, and a level for each pixel."""
        return (_ENDS + math.prod(self.shape),)

    def encode(self, values: np.ndarray) -> np.ndarray:
        """Return rows of the layer as the file holds them."""
        flat = np.reshape(values, (len(values), -1)).astype(np.float32)
        read = compress(flat) if self.is_linear else flat
        ends = np.stack([read.min(axis=1), read.max(axis=1)], axis=1)
        low, width = ends[:, :1], np.maximum(ends[:, 1:] - ends[:, :1], 1e-30)
        shares = (read - low) / width
        levels = np.round(255 * (np.sqrt(shares) if self.is_linear else shares))
        return np.concatenate([ends.view(np.uint8), levels.astype(np.uint8)], axis=1)

    def decode(self, kept: np.ndarray) -> np.ndarray:
        """Return rows of the layer as networks and losses take them, float32."""
        low, high = np.ascontiguousarray(kept[:, :_ENDS]).view(np.float32).T[..., None]
        values = kept[:, _ENDS:] * np.float32(1 / 255)
        if self.is_linear:
            values *= values
        values *= high - low
        values += low
        return (np.expm1(values) if self.is_linear else values).reshape(-1, *self.shape)


def columns(features: Collection[str], size: int) -> dict[str, Column | LayerColumn]:
    """Return the columns of features by name, for pictures of `size` × `size` pixels.

    Raises:
        ValueError: if a feature cannot be kept.
    """
    out: dict[str, Column | LayerColumn] = {}
    for name in features:
        if name in _BYTES:
            out[name] = Column((size, size, _BYTES[name]), np.uint8)
        elif name in _BITS:
            out[name] = Column((size, size, _BITS[name]), np.uint8, is_packed=True)
        elif name.removeprefix(PREDICTED) in _LAYERS:
            out[name] = LayerColumn((size, size, 1), is_linear=name in _LAYERS)
        elif name == "environment":
            out[name] = LayerColumn((*STORED_SHAPE, 1), is_linear=True)
        elif name in _NUMBERS:
            out[name] = Column(*_NUMBERS[name])
        else:
            raise ValueError(f"{name} is no feature that photos are kept with")
    return out


def count_in(folder: Path) -> int | None:
    """Return how many rows a folder holds, or None if not all of them are there.

    Raises:
        ValueError: if its record is broken.
    """
    path = folder / _RECORD
    if not path.is_file():
        return None
    mend = f"remove {folder}, and the same command makes them again"
    with untrusted.naming(path, "the record of photos", mend):
        return int(untrusted.read_json(path)["rows"])


class Kept:
    """Rows of some features in a folder.

    Args:
        folder: folder of the files; it is made by `begin`.
        count: number of rows.
        features: names of the features.
        size: height and width of the pictures in pixels.
    """

    def __init__(self, folder: Path, count: int, features: Collection[str], size: int):
        self.folder, self.count = folder, count
        self._columns = columns(features, size)
        self._maps: dict[str, np.ndarray] = {}

    @property
    def features(self) -> tuple[str, ...]:
        """The names of the features."""
        return tuple(self._columns)

    @property
    def is_complete(self) -> bool:
        """Whether all rows are there."""
        return (self.folder / _RECORD).is_file()

    @property
    def bytes_of_a_row(self) -> int:
        """The size of a row on the disk."""
        kept = self._columns.values()
        return sum(np.dtype(one.dtype).itemsize * math.prod(one.kept_shape) for one in kept)

    def begin(self) -> list[range]:
        """Make the files where they are missing, and return the rows that are to be made.

        Raises:
            OSError: if the disk has no room for them.
        """
        whole = [
            range(first, min(first + PART, self.count)) for first in range(0, self.count, PART)
        ]
        marks = self.folder / "made.npy"
        if not marks.is_file():
            self._check_room()
            with atomic.replacing(self.folder) as partial:
                partial.mkdir(parents=True)
                for name, column in self._columns.items():
                    shape = (self.count, *column.kept_shape)
                    path = partial / f"{name}.npy"
                    np.lib.format.open_memmap(path, "w+", column.dtype, shape)
                np.save(partial / marks.name, np.zeros(len(whole), np.uint8))
        with untrusted.naming(marks, "photos"):
            is_made = np.load(marks)
            return [part for part, done in zip(whole, is_made, strict=True) if not done]

    def write(self, first: int, features: Mapping[str, Any]) -> None:
        """Write consecutive rows; several processes may write different rows.

        They are written as bytes, since a memory map of a full disk would end the process.

        Raises:
            OSError: if they cannot be written, with the file and the mend.
        """
        for name, column in self._columns.items():
            rows = np.ascontiguousarray(column.encode(np.asarray(features[name])))
            path = self.folder / f"{name}.npy"
            start = np.load(path, mmap_mode="r").offset
            with atomic.naming_writer(path), path.open("r+b", buffering=0) as file:
                file.seek(start + first * rows[0].nbytes)
                left = rows.view(np.uint8).reshape(-1).data
                while left:
                    left = left[file.write(left) :]
                os.fsync(file.fileno())  # or lost power leaves rows of zeros that are marked

    def mark(self, part: range) -> None:
        """Note that the rows of a part are made, so that they are not made again."""
        marks = np.load(self.folder / "made.npy", mmap_mode="r+")
        marks[part.start // PART] = 1

    def finish(self, record: Mapping[str, Any]) -> None:
        """Write down that all rows are there, and what they follow from."""
        content = {"rows": self.count, "features": self.features, **record}
        atomic.write(self.folder / _RECORD, json.dumps(content, indent=1) + "\n")

    def read(self, rows: Sequence[int] | np.ndarray, features: Collection[str]) -> dict[str, Any]:
        """Return some rows of some features by name, as networks and losses take them."""
        out = {}
        for name in features:
            if name not in self._maps:
                self._maps[name] = np.load(self.folder / f"{name}.npy", mmap_mode="r")
            out[name] = self._columns[name].decode(self._maps[name][rows])
        return out

    def _check_room(self) -> None:
        self.folder.parent.mkdir(parents=True, exist_ok=True)
        needed, free = self.count * self.bytes_of_a_row, shutil.disk_usage(self.folder.parent).free
        if needed + _RESERVE > free:
            fits = max(0, free - _RESERVE) // self.bytes_of_a_row
            raise OSError(
                f"{self.folder.parent} needs {needed / 1e9:.1f} GB for {self.count} photos, and "
                f"its disk has {free / 1e9:.1f} free: make room, pass another --out, or begin "
                f"another run with --photos {fits} or fewer"
            )
