"""Table 1's measures as Keras metrics: gathered batch by batch, in any split the same.

What the examples are judged by is in `metrics`; albedos and log10 s need no more than
`keras.metrics.MeanAbsoluteError`. An example of weight one half counts half.
"""

from typing import Any

import keras
from keras import ops

from lime_keras import metrics


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
        intersection, union = metrics.overlap(mask, predicted)
        self.intersection.assign_add(ops.sum(weight * intersection))
        self.union.assign_add(ops.sum(weight * union))

    def result(self) -> Any:
        """Σ intersection / Σ union."""
        return metrics.overlap_ratio(*map(ops.convert_to_tensor, (self.intersection, self.union)))


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
    """Mean over the examples of `metrics.masked_relative_error`, at least 0."""

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
        super().update_state(metrics.masked_relative_error(*images), sample_weight)
