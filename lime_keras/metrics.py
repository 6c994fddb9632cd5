"""Table 1's measures, one number per example.

In NumPy; those that `streaming_metrics` shares take Keras tensors alike.
"""

from typing import Any

import numpy as np

from lime_keras.arrays import namespace
from lime_keras.optics import shininess


def overlap(mask: Any, predicted: Any) -> tuple[Any, Any]:
    """Pixels `(B,)` of the intersection and of the union of two coverages, each cut at one half.

    Args:
        mask: `(B, H, W, 1)`, of NumPy or Keras.
        predicted: the same.
    """
    xp = namespace(mask, predicted)
    true, found = mask >= 0.5, predicted >= 0.5
    both = xp.where(xp.logical_and(true, found), 1.0, 0.0)
    either = xp.where(xp.logical_or(true, found), 1.0, 0.0)
    return xp.sum(both, axis=(1, 2, 3)), xp.sum(either, axis=(1, 2, 3))


def overlap_ratio(intersection: Any, union: Any) -> Any:
    """IoU of pixel counts of any shape. Two empty masks agree: 1."""
    xp = namespace(intersection, union)
    return xp.where(union > 0, intersection / xp.maximum(union, 1e-9), 1.0)


def intersection_over_union(mask: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """IoU `(B,)` of two coverages `(B, H, W, 1)`, each cut at one half.

    Two empty masks agree: 1.
    """
    return overlap_ratio(*overlap(mask, predicted))


def albedo_absolute_error(albedo: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Mean absolute error `(B,)` over the channels of `(B, C)` albedos."""
    return np.mean(np.abs(predicted - albedo), axis=-1)


def albedo_squared_error(albedo: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Mean squared error `(B,)` over the channels of `(B, C)` albedos."""
    return np.mean(np.square(predicted - albedo), axis=-1)


def bin_distance(exponent: np.ndarray, probabilities: np.ndarray) -> np.ndarray:
    """How many bins the winning class of `(B, 8)` lies from the true exponent's, `(B,)` ≥ 0."""
    return np.abs(np.argmax(probabilities, axis=-1) - shininess.bin_of(exponent))


def log_exponent_error(exponent: np.ndarray, log_predicted: np.ndarray) -> np.ndarray:
    """|Δ log10 s| `(B,)`."""
    return np.abs(np.log10(exponent) - log_predicted)


def masked_relative_error(shading: Any, predicted: Any, mask: Any) -> Any:
    """Σ|predicted − shading| / Σ shading over each mask, `(B,)`.

    0 where the mask is empty, and where the shading is black, whose relative error is boundless.

    Args:
        shading: linear radiance `(B, H, W, 1)`, at least 0, of NumPy or Keras.
        predicted: the same.
        mask: coverage `(B, H, W, 1)`, cut at one half.
    """
    xp = namespace(shading, predicted, mask)
    inside = xp.where(mask >= 0.5, 1.0, 0.0)
    wrong = xp.sum(xp.abs(predicted - shading) * inside, axis=(1, 2, 3))
    size = xp.sum(shading * inside, axis=(1, 2, 3))
    return xp.where(size > 0, wrong / xp.maximum(size, 1e-12), 0.0)
