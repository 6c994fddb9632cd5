"""Table 1's measures, one number per example, in NumPy."""

import numpy as np

from lime_keras import shininess


def intersection_over_union(mask: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """IoU `(B,)` of two coverages `(B, H, W, 1)`, each cut at one half.

    Two empty masks agree: 1.
    """
    true, found = mask >= 0.5, predicted >= 0.5
    intersection = np.sum(true & found, axis=(1, 2, 3))
    union = np.sum(true | found, axis=(1, 2, 3))
    return np.where(union > 0, intersection / np.maximum(union, 1), 1.0)


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


def masked_relative_error(
    shading: np.ndarray, predicted: np.ndarray, mask: np.ndarray
) -> np.ndarray:
    """Σ|predicted − shading| / Σ shading over each mask, `(B,)`.

    0 where the mask is empty, and where the shading is black, whose relative error is boundless.
    """
    inside = mask >= 0.5
    wrong = np.sum(np.abs(predicted - shading) * inside, axis=(1, 2, 3))
    size = np.sum(shading * inside, axis=(1, 2, 3))
    return np.where(size > 0, wrong / np.maximum(size, 1e-12), 0.0)
