"""Batches of environment maps in `keras.ops`: smaller maps, and look-ups in directions."""

import math
from typing import Any

import numpy as np
from keras import ops


def reduced(radiance: Any, rows: int) -> Any:
    """Return maps `(B, H, W)` averaged to at most `rows` rows, W shrinking as H does."""
    batch, height, width = radiance.shape
    factor = height // rows
    if factor <= 1:
        return radiance
    height, columns = height // factor, width // factor
    total = ops.mean(ops.reshape(radiance, (batch, height, factor, width)), axis=2)
    return ops.mean(ops.reshape(total, (batch, height, columns, factor)), axis=3)


def place(x: Any, y: Any, z: Any) -> tuple[Any, Any]:
    """Return u in [-1/2, 1/2] and v in [0, 1] of directions of any length, of any one shape.

    u and v are shares of a map's sides (`optics.environment`); u has a period of 1.
    """
    u = ops.arctan2(x, -z) / (2 * math.pi)
    return u, ops.arctan2(ops.sqrt(ops.square(x) + ops.square(z)), y) / math.pi


def looked_up(radiance: Any, u: Any, v: Any) -> Any:
    """Return the bilinear values `(B, ...)` of maps `(B, H, W)` at `place`s `(B, ...)`.

    Longitude wraps; at the poles the row is clamped.
    """
    batch, height, width = radiance.shape
    flat = ops.reshape(radiance, (-1,))
    first = np.arange(batch, dtype=np.int32).reshape(-1, *(1,) * (len(u.shape) - 1)) * height
    column, row = u * width - 0.5, ops.clip(v * height - 0.5, 0.0, height - 1.0)
    left, top = ops.floor(column), ops.floor(row)
    across, down = column - left, row - top
    left, top = ops.cast(left, "int32"), ops.cast(top, "int32")
    right, bottom = ops.mod(left + 1, width), ops.minimum(top + 1, height - 1)
    left = ops.mod(left, width)

    def blend(row: Any) -> Any:
        start = (first + row) * width
        here = ops.take(flat, start + left)
        return here + across * (ops.take(flat, start + right) - here)

    upper = blend(top)
    return upper + down * (blend(bottom) - upper)
