"""Tone mapping of linear radiance to sRGB: the white point and the image."""

import numpy as np

_WHITE_PERCENTILE = 99.0
_LEAST_WHITE = 1e-4
"""Least radiance shown as white, so that a layer that is black everywhere stays black."""


def white_point(layer: np.ndarray, mask: np.ndarray) -> float:
    """Return the radiance to show as white: a true layer's 99th percentile inside the mask.

    Args:
        layer: true linear radiance `(H, W, C)`.
        mask: true coverage `(H, W, 1)`.
    """
    inside = layer[mask[..., 0] >= 0.5]
    white = float(np.percentile(inside, _WHITE_PERCENTILE)) if inside.size else 1.0
    return max(white, _LEAST_WHITE)


def coloured(values: np.ndarray) -> np.ndarray:
    """Return a grey `(H, W, 1)` or colour `(H, W, 3)` image as colour, clipped to [0, 1]."""
    return np.repeat(np.clip(values, 0.0, 1.0), 3 // values.shape[-1], axis=-1)
