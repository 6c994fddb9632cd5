"""How shading of any brightness is put before a network: log(1 + x).

A lamp in a mirror is 10,000 times brighter than a wall. The networks exchange S and M compressed;
every public function outside the networks takes and returns linear radiance.
"""

from typing import Any

from lime_keras.arrays import namespace

HIGHEST_COMPRESSED = 11.0
"""log(1 + 59,873): the largest value that `expand` answers, so that float16 does not overflow."""


def compress(linear: Any) -> Any:
    """log(1 + max(x, 0)) of radiance of any shape: 0 at 0, near-linear for dim, log for bright."""
    xp = namespace(linear)
    return xp.log1p(xp.maximum(linear, 0.0))


def expand(compressed: Any) -> Any:
    """Radiance of a compressed value, clipped to 0 … 59,873; the inverse of `compress`."""
    xp = namespace(compressed)
    x = xp.clip(compressed, 0.0, HIGHEST_COMPRESSED)
    # e^x − 1 = 2 e^(x/2) sinh(x/2), no less exact; tf2onnx does not know expm1. In this order no
    # gradient leaves float16 on its way back.
    return xp.exp(0.5 * x) * (2.0 * xp.sinh(0.5 * x))
