"""The G-buffers of a bank: coverage, normals and the spread of the mirror directions, compressed.

A pixel that the object covers has an octahedral code of its normal (`optics.octahedral`) and a code
of its spread. At an edge or a crease it has two surfaces, each with a normal and a spread of its
own, and the first one's share. On smooth surfaces a code is nearly what its left, upper and upper
left neighbours make of it, left + up − (upper left), and only the residual is stored: in one byte,
or in two if it is large. Uncovered pixels are taken to have a residual of 0, so decoding is two
running sums.
"""

import itertools
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras.optics import octahedral

from . import bank

INDEX = np.dtype([("offset", "<u8"), ("length", "<u4"), ("shape", "<u4"), ("camera", "<f4", 4)])
"""An entry of a shard's index: its place in bytes, the row of its shape, fx, fy, cx, cy in px."""
ONE_SURFACE = 255
"""Share of the first surface in pixels that see one surface only."""
_MODULUS = 4096
_LOST_BITS = octahedral.BITS - 8  # of the second surface's codes: 0.5° in the mean, at a rough edge
_LARGE = 255  # in place of a residual that has two bytes elsewhere
_FINEST = 14
WIDEST = _FINEST + 1
"""Largest code of the spread."""
_LEVEL = 6  # of zlib: 1 % larger than the highest level, in a third of the time


def spread_code(variance: np.ndarray) -> np.ndarray:
    """Return the codes, uint8 0 … 15, of variances v of mirror directions in a pixel, 0 … 1.

    The code is 0 for v < 2^-14, else 1 + floor(log2 v + 14): a step is a factor of two.
    """
    steps = np.floor(np.log2(np.maximum(variance, 2.0 ** -(_FINEST + 1))) + _FINEST + 1)
    return np.clip(steps, 0, WIDEST).astype(np.uint8)


def variance_of(code: np.ndarray) -> np.ndarray:
    """Return the variances, float32 0 … 1, in the middle of the steps of codes (`spread_code`).

    The middle is that of the logarithms; it is 0 for code 0, and 1 for code 15.
    """
    middle = 2.0 ** (np.asarray(code, np.float32) - (_FINEST + 0.5))
    return np.where(code == 0, 0, np.minimum(middle, 1)).astype(np.float32)


def encode(
    coverage: np.ndarray, share: np.ndarray, normal: np.ndarray, spread: np.ndarray
) -> bytes:
    """Compress a G-buffer.

    Args:
        coverage: share of each pixel that the object covers, in 255ths, `(S, S)` uint8.
        share: share of the covered part that shows the pixel's first surface, in 255ths, at least
            1, `(S, S)` uint8; `ONE_SURFACE` where the pixel sees one surface.
        normal: octahedral codes of both surfaces' normals, `(2, S, S, 2)` uint16.
        spread: codes of both surfaces' spread, `(2, S, S)` uint8.

    Returns:
        The bytes, from which `decode` restores the arrays where there is a surface. Of the second
        surface's codes, the last four bits are lost.
    """
    covered = coverage > 0
    two = covered & (share < ONE_SURFACE)
    residual = _residuals(covered, normal[0])
    # The least number of bits: 0, −1, 1, −2, … become 0, 1, 2, 3, …
    folded = np.where(residual < 0, -2 * residual - 1, 2 * residual)
    large = folded >= _LARGE
    compressor = zlib.compressobj(_LEVEL, zlib.DEFLATED, -15, 9, zlib.Z_FILTERED)
    parts = (
        np.packbits(covered),
        coverage[covered],
        share[covered],
        spread[0][covered],
        np.where(large, _LARGE, folded).astype(np.uint8),
        spread[1][two],
        (normal[1][two] >> _LOST_BITS).T.astype(np.uint8),
        folded[large].astype("<u2"),
    )
    blocks = []
    for part in parts:
        blocks.append(compressor.compress(part.tobytes()))
        blocks.append(compressor.flush(zlib.Z_BLOCK))  # each part has Huffman codes of its own
    return b"".join(blocks) + compressor.flush()


def decode(data: bytes, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Restore a G-buffer from the bytes of `encode`.

    Args:
        data: the bytes.
        size: height and width in pixels.

    Returns:
        Coverage, share, normals and spread as in `encode`; normals and spread are 0 where there is
        no surface, and share is `ONE_SURFACE` where there is no second one.

    Raises:
        ValueError: if the bytes are no G-buffer of this size.
    """
    pixels = size * size
    start = -(-pixels // 8)
    most = start + 12 * pixels  # a pixel of two surfaces, the first's code far from predicted
    decoder = zlib.decompressobj(-15)
    try:
        raw = np.frombuffer(decoder.decompress(data, most + 1), np.uint8)
    except zlib.error as error:
        raise ValueError(f"the bytes cannot be decompressed ({error})") from error
    if len(raw) > most:
        raise ValueError(f"the bytes are no G-buffer of {size}×{size} pixels")
    if not decoder.eof:
        raise ValueError("the bytes cannot be decompressed (some are cut off)")
    # Split the bytes: one part after another, each as long as what is covered.
    covered = np.flatnonzero(np.unpackbits(raw[:start]))
    count = len(covered)
    ends = np.cumsum([start, count, count, count, 2 * count])
    coverage_there, share_there, spread_there, small = (
        raw[low:high] for low, high in itertools.pairwise(ends)
    )
    two = covered[: len(share_there)][share_there < ONE_SURFACE]
    middle = ends[-1] + len(two)
    end = middle + 2 * len(two)
    large = np.flatnonzero(small == _LARGE)
    if len(raw) != end + 2 * len(large) or (count and covered[-1] >= pixels):
        raise ValueError(f"the bytes are no G-buffer of {size}×{size} pixels")
    # Undo the prediction of normals.
    folded = small.astype(np.uint16)
    folded[large] = raw[end:].view("<u2")
    residual = ((folded >> 1) ^ -(folded & 1)).astype(np.int16).astype(np.uint32)
    # Spread everything over the image.
    coverage, share = np.zeros(pixels, np.uint8), np.full(pixels, ONE_SURFACE, np.uint8)
    coverage[covered], share[covered] = coverage_there, share_there
    spread = np.zeros((2, pixels), np.uint8)
    spread[0][covered], spread[1][two] = spread_there, raw[ends[-1] : middle]
    codes = []
    for part in residual.reshape(2, count):
        sums = np.zeros(pixels, np.uint32)
        sums[covered] = part
        sums = sums.reshape(size, size).cumsum(axis=1, dtype=np.uint32)
        sums.cumsum(axis=0, dtype=np.uint32, out=sums)
        codes.append(sums.ravel()[covered] % _MODULUS)
    coarse = raw[middle:end].reshape(2, len(two)).astype(np.uint32) << _LOST_BITS
    # The middle of what the lost bits may have been.
    coarse = np.minimum(coarse + (1 << _LOST_BITS - 1), octahedral.LARGEST)
    # The two codes of a normal are one number here: half as much is written.
    normal = np.zeros((2, pixels), "<u4")
    normal[0][covered] = codes[0] | codes[1] << 16
    normal[1][two] = coarse[0] | coarse[1] << 16
    square = (size, size)
    return (
        coverage.reshape(square),
        share.reshape(square),
        normal.view("<u2").reshape(2, *square, 2),
        spread.reshape(2, *square),
    )


def _residuals(covered: np.ndarray, codes: np.ndarray) -> np.ndarray:
    """Return how far the code of each covered pixel is from the one predicted by its neighbours.

    Returns:
        `(2, N)` int64 in −2048 … 2047, modulo 4096.
    """
    size = len(covered)
    # A residual of 0 outside: there, a row adds to the row above it what it adds in the last
    # covered pixel to the left, and nothing where there is none.
    columns = np.where(covered, np.arange(1, size + 1), 0)
    held = np.maximum.accumulate(columns, axis=1)
    codes = codes.astype(np.int32)
    above = np.zeros((size, 2), np.int32)
    step = np.zeros((size, size + 1, 2), np.int32)
    for row in np.flatnonzero(covered.any(axis=1)):
        added = np.concatenate([np.zeros((1, 2), np.int32), codes[row] - above])[held[row]]
        step[row, 1:] = added
        above = above + added
    half = _MODULUS // 2
    return ((np.diff(step, axis=1)[covered] + half) % _MODULUS - half).T


class GeometryBank:
    """The G-buffers of a bank, read from disk as they are asked for.

    Attributes:
        size: height and width in pixels.
        camera: fx, fy, cx, cy in pixels of each entry, `(N, 4)` float32.
        shape: row of each entry's shape in `shape_names`, `(N,)`.
        shape_names: names of the shapes.

    Args:
        folder: folder by `lime-render bank`.

    Raises:
        FileNotFoundError: if the bank is incomplete or a file is missing.
        ValueError: if the bank is of another version, or a file is cut off or broken.
    """

    def __init__(self, folder: Path):
        manifest = bank.manifest(folder)
        self.size: int = manifest["size"]
        self.shape_names: list[str] = manifest["shapes"]
        names = sorted(name for name in manifest["files"] if name.startswith("geometry/"))
        self._paths = [bank.file(folder, name) for name in names if name.endswith(".bin")]
        tables = [read_index(path, len(self.shape_names)) for path in self._paths]
        count = sum(map(len, tables))
        if count != manifest["count"] or not count:
            raise ValueError(
                f"{folder / 'geometry'} holds {count} entries, and {bank.MANIFEST} tells of "
                f"{manifest['count']}: render the bank anew"
            )
        self._shards = [np.memmap(path, np.uint8, "r") for path in self._paths]
        self._first = np.cumsum([0, *map(len, tables)])
        self._table = np.concatenate(tables)
        self.camera = np.ascontiguousarray(self._table["camera"])
        self.shape = self._table["shape"].astype(np.int64)

    def __len__(self) -> int:
        return len(self._table)

    def read(self, indices: np.ndarray) -> dict[str, np.ndarray]:
        """Read G-buffers.

        Args:
            indices: indices of the entries, `(B,)`.

        Returns:
            `coverage` and `share` `(B, S, S)` uint8 in 255ths, `normal` `(B, 2, S, S, 2)` uint16
            octahedral codes of the unit normals in camera space, 0 where there is no surface,
            `spread` `(B, 2, S, S)` uint8 (see `variance_of`), and `camera` `(B, 4)` float32, fx,
            fy, cx, cy in pixels.

        Raises:
            IndexError: if an index is not in 0 … N − 1.
            ValueError: if an entry is broken.
        """
        indices = np.asarray(indices)
        outside = indices[(indices < 0) | (indices >= len(self))]
        if len(outside):
            raise IndexError(f"the bank has entries 0 to {len(self) - 1}, so none of {outside[0]}")
        count, size = len(indices), self.size
        out = {
            "coverage": np.empty((count, size, size), np.uint8),
            "share": np.empty((count, size, size), np.uint8),
            "normal": np.empty((count, 2, size, size, 2), np.uint16),
            "spread": np.empty((count, 2, size, size), np.uint8),
            "camera": self.camera[indices],
        }
        for place, index in enumerate(indices):
            shard = int(np.searchsorted(self._first, index, "right")) - 1
            offset, length = (int(self._table[name][index]) for name in ("offset", "length"))
            data: Any = self._shards[shard][offset : offset + length]
            try:
                arrays = decode(data, self.size)
            except ValueError as error:
                entry = index - self._first[shard]
                raise ValueError(
                    f"{self._paths[shard]}, entry {entry}: {error}; delete the file and run the "
                    "same `lime-render bank` again"
                ) from error
            for name, array in zip(("coverage", "share", "normal", "spread"), arrays, strict=True):
                out[name][place] = array
        return out


def read_index(path: Path, shapes: int) -> np.ndarray:
    """Read the index of a shard, and check that its entries lie in the shard.

    Args:
        path: file of the shard; the index lies beside it.
        shapes: number of the bank's shapes.

    Returns:
        Entries `(N,)` of type `INDEX`.

    Raises:
        FileNotFoundError: if the index is missing.
        ValueError: if the index is broken, or names bytes or shapes that are not there.
    """
    beside = path.with_suffix(".npy")
    again = f"delete {path.with_suffix('.*')} and run the same `lime-render bank` again"
    table = np.array(bank.array(beside, again))
    if table.dtype != INDEX or table.ndim != 1:
        raise ValueError(f"{beside} is no index of a shard: {again}")
    # Compared apart, as their sum may be larger than 64 bits hold.
    size = path.stat().st_size
    if (table["offset"] > size).any() or (table["length"] > size - table["offset"]).any():
        raise ValueError(
            f"{path} has {size} bytes, and its index tells of more: it is cut off; {again}"
        )
    if len(table) and table["shape"].max() >= shapes:
        raise ValueError(
            f"{beside} names shape {table['shape'].max()}, and {bank.MANIFEST} lists {shapes}: "
            f"{again}"
        )
    if not np.isfinite(table["camera"]).all() or (table["camera"][:, :2] <= 0).any():
        raise ValueError(f"{beside} has a camera that is none: {again}")
    return table
