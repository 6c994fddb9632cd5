"""The masked mean, and what an empty mask means: a mean of 0, with a gradient of 0."""

from typing import Any

import numpy as np

from lime_keras.arrays import namespace

_LEAST_WEIGHT = 1e-6


def masked_mean(values: Any, mask: Any) -> Any:
    """Mean of `values` `(B, H, W, C)` over each example's mask, shape `(B,)`.

    Args:
        values: any finite numbers inside the mask; outside it even NaN is ignored.
        mask: `(B, H, W, 1)` coverage in [0, 1], the weight of each pixel.

    Returns:
        The weighted mean over pixels and channels, in single precision at least. An empty mask
        gives 0, not NaN.
    """
    xp = namespace(values, mask)
    # A full mask of 256 × 256 sums to more than float16's largest number.
    mask = xp.multiply(mask, np.float32(1))
    inside = xp.where(mask > 0, values, np.float32(0))
    weight = xp.sum(mask, axis=(1, 2, 3))
    total = xp.sum(inside * mask, axis=(1, 2, 3))
    return total / (xp.maximum(weight, _LEAST_WEIGHT) * values.shape[-1])
