"""Table 1's measures: of each example a number, in NumPy, and as Keras metrics.

Keras' are gathered batch by batch, in any split the same; an example of weight one half counts
half. Albedos and log10 s need no more than `keras.metrics.MeanAbsoluteError`. The functions that
both share take Keras tensors, too.
"""

from typing import Any

import keras
import numpy as np
from keras import ops

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


class PooledIoU(keras.metrics.Metric):
    """IoU in [0, 1] of the pixels of all masks together; 1 where none holds any."""

    def __init__(self, name: str = "pooled_iou", dtype: Any = None):
        super().__init__(name=name, dtype=dtype)
        self.intersection = self.add_variable((), "zeros", name="intersection")
        self.union = self.add_variable((), "zeros", name="union")

    def update_state(self, mask: Any, predicted: Any, sample_weight: Any = None) -> None:
        """Take in a batch.

        Args:
            mask: coverage `(B, H, W, 1)`, cut at one half.
            predicted: the same.
            sample_weight: of each example, `(B,)`; by default 1.
        """
        mask, predicted = (ops.convert_to_tensor(one, self.dtype) for one in (mask, predicted))
        weight = ops.convert_to_tensor(1.0 if sample_weight is None else sample_weight, self.dtype)
        intersection, union = overlap(mask, predicted)
        self.intersection.assign_add(ops.sum(weight * intersection))
        self.union.assign_add(ops.sum(weight * union))

    def result(self) -> Any:
        """Σ intersection / Σ union."""
        return overlap_ratio(*map(ops.convert_to_tensor, (self.intersection, self.union)))


class WithinBins(keras.metrics.Mean):
    """Share in [0, 1] of the exponents whose bin is estimated to within so many.

    Args:
        distance: 0 asks for the right bin, 1 also takes its neighbours.
        name: of the metric.
        dtype: of its state; by default single precision.
    """

    def __init__(self, distance: int, name: str = "within_bins", dtype: Any = None):
        super().__init__(name=name, dtype=dtype)
        self._distance = distance

    def update_state(self, exponent_bin: Any, predicted: Any, sample_weight: Any = None) -> None:
        """Take in a batch.

        Args:
            exponent_bin: true classes 0…7 `(B,)`, as of `shininess.bin_of`.
            predicted: the same; NaN is within no distance.
            sample_weight: of each example, `(B,)`; by default 1.
        """
        distance = ops.abs(ops.cast(exponent_bin, self.dtype) - ops.cast(predicted, self.dtype))
        super().update_state(distance <= self._distance, sample_weight)

    def get_config(self) -> dict[str, Any]:
        """Arguments that make the same metric anew."""
        return super().get_config() | {"distance": self._distance}


class MaskedRelativeError(keras.metrics.Mean):
    """Mean over the examples of `masked_relative_error`, at least 0."""

    def update_state(
        self, shading: Any, predicted: Any, mask: Any, sample_weight: Any = None
    ) -> None:
        """Take in a batch.

        Args:
            shading: linear radiance `(B, H, W, 1)`.
            predicted: linear radiance `(B, H, W, 1)`.
            mask: coverage `(B, H, W, 1)`.
            sample_weight: of each example, `(B,)`; by default 1.
        """
        images = (ops.convert_to_tensor(one, self.dtype) for one in (shading, predicted, mask))
        super().update_state(masked_relative_error(*images), sample_weight)
