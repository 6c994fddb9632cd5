"""The compression of shading for the networks, log(1 + x), and its inverse.

A lamp in a mirror is 10,000 times brighter than a wall. The networks exchange S and M compressed,
and so do their losses; every other public function takes and returns linear radiance.
"""

from typing import Any

from lime_keras.optics.namespace import namespace

HIGHEST_COMPRESSED = 11.0
"""Largest compressed value, log(1 + 59,873): `expand` clips there, so float16 does not overflow."""


def compress(linear: Any) -> Any:
    """Return log(1 + max(x, 0)) of linear radiance x of any shape, array or tensor.

    The result is at least 0: nearly linear for dim radiance, logarithmic for bright radiance.
    """
    xp = namespace(linear)
    return xp.log1p(xp.maximum(linear, 0.0))


def expand(compressed: Any) -> Any:
    """Return the linear radiance of compressed values of any shape, array or tensor.

    `expand` is the inverse of `compress`, clipped to 0 … 59,873.

    Example:
        >>> round(float(expand(compress(100.0))), 6)
        100.0
    """
    xp = namespace(compressed)
    x = xp.clip(compressed, 0.0, HIGHEST_COMPRESSED)
    # e^x − 1 = 2 e^(x/2) sinh(x/2) is as exact as expm1, which tf2onnx does not support. In this
    # order of the factors no gradient overflows float16.
    return xp.exp(0.5 * x) * (2.0 * xp.sinh(0.5 * x))
