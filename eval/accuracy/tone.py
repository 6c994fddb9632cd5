"""High dynamic range for the eye: which radiance becomes white, and the sRGB image of it."""

import numpy as np

from lime_keras.optics import colour

_WHITE_PERCENTILE = 99.0
_LEAST_WHITE = 1e-4
"""Radiance; a layer that is black throughout stays black."""


def white_point(layer: np.ndarray, mask: np.ndarray) -> float:
    """Radiance shown as white: the 99th percentile of a true layer `(H, W, C)` inside the mask."""
    inside = layer[mask[..., 0] >= 0.5]
    white = float(np.percentile(inside, _WHITE_PERCENTILE)) if inside.size else 1.0
    return max(white, _LEAST_WHITE)


def tonemap(radiance: np.ndarray, white: float) -> np.ndarray:
    """Radiance `(H, W, 1 or 3)` as sRGB `(H, W, 3)`; `white` and all above become 1."""
    return coloured(colour.linear_to_srgb(np.clip(radiance / white, 0.0, 1.0)))


def coloured(values: np.ndarray) -> np.ndarray:
    """Grey `(H, W, 1)` or colour `(H, W, 3)`, clipped, as colour."""
    return np.repeat(np.clip(values, 0.0, 1.0), 3 // values.shape[-1], axis=-1)
