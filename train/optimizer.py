"""The Adam optimiser with gradient norms and a check for gradients that are not finite."""

from collections.abc import Sequence
from typing import Any

import keras
from keras import ops


class WatchedAdam(keras.optimizers.Adam):
    """Adam that records the norm of each subnetwork's gradient and ignores non-finite gradients.

    A single example with a NaN gradient would otherwise make every weight NaN. Then it would no
    longer be possible to find out which example it was.

    Args:
        learning_rate: Adam's learning rate, a number or a schedule.
        groups: name and number of trainable variables of each subnetwork, in the variables' order.
    """

    def __init__(self, learning_rate: Any, groups: Sequence[tuple[str, int]], **kwargs: Any):
        super().__init__(learning_rate, **kwargs)
        self._groups = [(name, int(count)) for name, count in groups]

    def build(self, variables: list[keras.Variable]) -> None:
        """Create Adam's variables, and one for each gradient norm."""
        super().build(variables)
        # If the batch is split, each device has a part of the gradient. The sum of the parts' norms
        # is an upper bound of the gradient's norm, and it is not finite if any part is not.
        self._norms = {
            name: self.add_variable(
                (), dtype="float32", aggregation="sum", name=f"{name}_gradient_norm"
            )
            for name, _ in self._groups
        }

    def apply(self, grads: list[Any], trainable_variables: list[Any] | None = None) -> None:
        """Record the gradient norms and take Adam's step, with zero gradients if one is not finite.

        Args:
            grads: gradients, as for `keras.optimizers.Adam`.
            trainable_variables: variables of the gradients; needed unless `build` was called.
        """
        if not self.built and trainable_variables is not None:
            self.build(list(trainable_variables))
        start, finite = 0, True
        for name, count in self._groups:
            squares = [
                ops.sum(ops.square(ops.cast(gradient, "float32")))
                for gradient in grads[start : start + count]
            ]
            norm = ops.sqrt(sum(squares))
            self._norms[name].assign(norm)
            finite = ops.logical_and(finite, ops.isfinite(norm))
            start += count
        held = [ops.where(finite, gradient, ops.zeros_like(gradient)) for gradient in grads]
        super().apply(held, trainable_variables)

    @property
    def norms(self) -> dict[str, float]:
        """The norm of each subnetwork's gradient in the last step, by name."""
        return {name: float(ops.convert_to_numpy(norm.value)) for name, norm in self._norms.items()}


class LossScale(keras.optimizers.LossScaleOptimizer):
    """Keras' loss scaling, which reduces the scale if a gradient overflows on any device.

    Keras itself checks only the first of TensorFlow's devices: after an overflow on another device
    it would take the step and keep the scale.
    """

    def check_finite(self, grads: list[Any]) -> Any:
        """Return whether all gradients are finite on all devices, a boolean scalar."""
        finite = super().check_finite(grads)
        if keras.backend.backend() != "tensorflow":
            return finite
        import tensorflow as tf

        def on_all(strategy: Any, parts: Any) -> Any:
            return tf.reduce_all(tf.stack(strategy.experimental_local_results(parts)))

        return tf.distribute.get_replica_context().merge_call(on_all, args=(finite,))


def gradient_norms(optimizer: keras.optimizers.Optimizer) -> dict[str, float]:
    """Return the norms of a `WatchedAdam`, also if a `LossScale` wraps it."""
    return getattr(optimizer, "inner_optimizer", optimizer).norms
