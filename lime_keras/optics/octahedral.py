"""Unit vectors as two whole numbers: the octahedral map, in which every direction fits 24 bits.

A vector is projected onto the octahedron |x| + |y| + |z| = 1, whose lower half (z < 0) is folded
out to the corners of the square [-1, 1]². Each coordinate of the square becomes a whole number. The
axes ±x, ±y and ±z come back exactly; any other direction is turned by 0.06° at most, by 0.021° in
the mean.
"""

from types import ModuleType
from typing import Any

import numpy as np

from lime_keras.arrays import namespace

BITS = 12
"""Bits of each of the two numbers."""
LARGEST = 2**BITS - 2
"""Largest code; an even number, so that the middle of the square has a code of its own."""


def encode(normal: np.ndarray) -> np.ndarray:
    """Return the octahedral codes `(..., 2)` uint16, 0 … `LARGEST`, of vectors `(..., 3)`.

    Args:
        normal: vectors of any length but 0.

    Raises:
        ValueError: if a vector is zero or not finite.
    """
    length = np.abs(normal).sum(axis=-1, keepdims=True)
    if not np.all((length > 0) & (length < np.inf)):
        raise ValueError("a vector is zero or not finite, and so has no direction: mend the shape")
    projected = normal / length
    square, z = projected[..., :2], projected[..., 2:]
    square = np.where(z < 0, _folded(np, square), square)
    return np.round((square + 1) * (LARGEST / 2)).astype(np.uint16)


def decode(codes: Any) -> Any:
    """Return the unit vectors `(..., 3)` float32 of octahedral codes.

    Args:
        codes: `(..., 2)` whole numbers, 0 … `LARGEST`; a NumPy array or a Keras tensor.
    """
    xp = namespace(codes)
    square = xp.multiply(codes, np.float32(2 / LARGEST)) - 1
    z = 1 - xp.sum(xp.abs(square), axis=-1, keepdims=True)
    square = xp.where(z < 0, _folded(xp, square), square)
    vector = xp.concatenate([square, z], axis=-1)
    return vector / xp.sqrt(xp.sum(vector * vector, axis=-1, keepdims=True))


def _folded(xp: ModuleType, square: Any) -> Any:
    """Return points `(..., 2)` of the square, mirrored at the diagonal of their quadrant."""
    far = 1 - xp.abs(square[..., ::-1])
    return xp.where(square < 0, -far, far)
