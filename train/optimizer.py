"""Adam that watches its gradients."""

from collections.abc import Sequence
from typing import Any

import keras
from keras import ops


class WatchedAdam(keras.optimizers.Adam):
    """Adam that keeps the norm of each subnetwork's gradient, and takes no step that is not finite.

    One example whose gradient is NaN would otherwise make every weight NaN, and nobody could tell
    any more which example it was.

    Args:
        learning_rate: Adam's, a number or a schedule.
        groups: name and number of trainable variables of each subnetwork, in the variables' order.
    """

    def __init__(self, learning_rate: Any, groups: Sequence[tuple[str, int]], **kwargs: Any):
        super().__init__(learning_rate, **kwargs)
        self._groups = [(name, int(count)) for name, count in groups]

    def build(self, variables: list[keras.Variable]) -> None:
        """Add a variable for each norm to Adam's own."""
        super().build(variables)
        # Devices that see a part of the batch each have a part of the gradient: the sum of their
        # norms bounds the whole one's, and shows what is not finite on any of them.
        self._norms = {
            name: self.add_variable(
                (), dtype="float32", aggregation="sum", name=f"{name}_gradient_norm"
            )
            for name, _ in self._groups
        }

    def apply(self, grads: list[Any], trainable_variables: list[Any] | None = None) -> None:
        """Record the norms; then Adam's step, or, if one of them is not finite, one of zero.

        Args:
            grads: as for `keras.optimizers.Adam`.
            trainable_variables: needed unless `build` was called before.
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
        """Norm of each subnetwork's gradient in the last step, by name."""
        return {name: float(ops.convert_to_numpy(norm.value)) for name, norm in self._norms.items()}


class LossScale(keras.optimizers.LossScaleOptimizer):
    """Keras' loss scale, held back by an overflow on any device.

    Keras itself asks the first of TensorFlow's devices alone; a step that overflows on another one
    would be taken, and the scale kept.
    """

    def check_finite(self, grads: list[Any]) -> Any:
        """Whether all gradients are finite on all devices, a boolean scalar."""
        finite = super().check_finite(grads)
        if keras.backend.backend() != "tensorflow":
            return finite
        import tensorflow as tf

        def on_all(strategy: Any, parts: Any) -> Any:
            return tf.reduce_all(tf.stack(strategy.experimental_local_results(parts)))

        return tf.distribute.get_replica_context().merge_call(on_all, args=(finite,))


def gradient_norms(optimizer: keras.optimizers.Optimizer) -> dict[str, float]:
    """`WatchedAdam.norms`, of one that may stand behind a loss scale."""
    return getattr(optimizer, "inner_optimizer", optimizer).norms
