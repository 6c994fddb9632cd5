"""The masked mean. An empty mask has a mean of 0, with a gradient of 0."""

from typing import Any

import numpy as np

from lime_keras.optics.namespace import namespace

_LEAST_WEIGHT = 1e-6


def masked_mean(values: Any, mask: Any) -> Any:
    """Return the mean of `values` over each example's mask, `(B,)`.

    Args:
        values: `(B, H, W, C)`, finite inside the mask; outside the mask even NaN is ignored.
        mask: coverage `(B, H, W, 1)` in [0, 1], the weight of each pixel.

    Returns:
        The weighted mean over pixels and channels, in the unit of `values` and in single precision
        at least. An empty mask gives 0, not NaN.

    Example:
        Of two pixels, the mask takes the first; the other may hold anything:

        >>> values, mask = np.array([3.0, np.nan]), np.array([1.0, 0.0])
        >>> masked_mean(values.reshape(1, 1, 2, 1), mask.reshape(1, 1, 2, 1)).tolist()
        [3.0]
        >>> masked_mean(values.reshape(1, 1, 2, 1), np.zeros((1, 1, 2, 1))).tolist()
        [0.0]
    """
    xp = namespace(values, mask)
    # Single precision: a full mask of 256 × 256 sums to more than float16's largest number.
    mask = xp.multiply(mask, np.float32(1))
    inside = xp.where(mask > 0, values, np.float32(0))
    weight = xp.sum(mask, axis=(1, 2, 3))
    total = xp.sum(inside * mask, axis=(1, 2, 3))
    return total / (xp.maximum(weight, _LEAST_WEIGHT) * values.shape[-1])
