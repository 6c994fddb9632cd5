"""Adam and Muon, with gradient norms and a check for gradients that are not finite."""

import math
from collections.abc import Sequence
from typing import Any

import keras
from keras import ops

from lime_keras.networks.efficientnet import PREFIX

_PRETRAINED_RATE = 0.1
"""Share of the learning rate for pretrained layers: the full rate destroys them in a few steps."""
_FEW_CHANNELS = 4
"""Largest number of channels that go into, or come out of, a convolution left to Adam."""
BY_ADAM = ("mirror",)
"""Subnetworks left to Adam: under Muon the deep levels of MirrorNet grow until others die."""


class _Watched:
    """A mixin for optimisers that records the norm of each subnetwork's gradient.

    A gradient that is not finite is taken as zero. A single example with a NaN gradient would
    otherwise make every weight NaN. Then it would no longer be possible to find out which example
    it was.

    The groups are name and number of trainable variables of each subnetwork, in their order.
    """

    add_variable: Any

    def __init__(self, learning_rate: Any, groups: Sequence[tuple[str, int]], **kwargs: Any):
        super().__init__(learning_rate, **kwargs)  # type: ignore[call-arg]
        self._groups = [(name, int(count)) for name, count in groups]

    def build(self, variables: list[keras.Variable]) -> None:
        """Create the optimiser's variables, and one for each gradient norm."""
        super().build(variables)  # type: ignore[misc]
        self._pretrained = {
            index for index, variable in enumerate(variables) if _is_pretrained(variable)
        }
        # If the batch is split, each device has a part of the gradient. The sum of the parts' norms
        # is an upper bound of the gradient's norm, and it is not finite if any part is not.
        self._norms = {
            name: self.add_variable(
                (), dtype="float32", aggregation="sum", name=f"{name}_gradient_norm"
            )
            for name, _ in self._groups
        }

    def apply(self, grads: list[Any], trainable_variables: list[Any] | None = None) -> None:
        """Record the gradient norms and take a step, with zero gradients if one is not finite."""
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
        safe = [ops.where(finite, gradient, ops.zeros_like(gradient)) for gradient in grads]
        super().apply(safe, trainable_variables)  # type: ignore[misc]

    def update_step(self, gradient: Any, variable: Any, learning_rate: Any) -> None:
        """Take a step for one variable, a smaller one if it is pretrained; Keras calls this."""
        # By index: under TensorFlow, variables come without their Keras names.
        if self._get_variable_index(variable) in self._pretrained:  # type: ignore[attr-defined]
            learning_rate = learning_rate * _PRETRAINED_RATE
        super().update_step(gradient, variable, learning_rate)  # type: ignore[misc]

    @property
    def norms(self) -> dict[str, float]:
        """The norm of each subnetwork's gradient in the last step, by name."""
        return {name: float(ops.convert_to_numpy(norm.value)) for name, norm in self._norms.items()}


def _is_pretrained(variable: keras.Variable) -> bool:
    return f"/{variable.path}".rpartition("/")[0].rpartition("/")[2].startswith(PREFIX)


class WatchedAdam(_Watched, keras.optimizers.Adam):
    """Adam, watched."""


class WatchedMuon(_Watched, keras.optimizers.Muon):
    """Muon for the inner convolutions, and Adam for everything else, watched.

    A kernel `(k, k, c_in, c_out)` is taken as a matrix `(k · k · c_in, c_out)`, whose momentum is
    made orthogonal by five Newton–Schulz steps. Convolutions from or to at most four channels (the
    first, where it reads no split of the colours, and the heads), pretrained layers, dense layers,
    biases and all of MirrorNet stay with Adam.
    """

    def __init__(self, learning_rate: Any, groups: Sequence[tuple[str, int]], **kwargs: Any):
        super().__init__(learning_rate, groups, weight_decay=None, adam_weight_decay=None, **kwargs)

    def _should_use_adamw(self, variable: keras.Variable) -> bool:
        """Return whether Adam updates a variable; Keras asks this method."""
        inner = len(variable.shape) == 4 and min(variable.shape[2:]) > _FEW_CHANNELS
        names = [name for name, count in self._groups for _ in range(count)]
        by_adam = names[self._get_variable_index(variable)] in BY_ADAM
        return not inner or by_adam or _is_pretrained(variable)

    def _muon_update_step(self, gradient: Any, variable: keras.Variable, lr: Any, m: Any) -> None:
        """Take Muon's step for one kernel; Keras calls this method."""
        self.assign_add(m, ops.add(gradient, m * (self.momentum - 1)))
        direction = ops.add(gradient, self.momentum * m)
        matrix = ops.reshape(direction, (-1, variable.shape[-1]))
        update = self.zeropower_via_newtonschulz5(matrix, self.ns_steps)
        # As large as a step of Adam, whatever the shape of the matrix.
        scale = ops.cast(lr, variable.dtype) * (self.rms_rate * math.sqrt(max(matrix.shape)))
        self.assign_sub(variable, ops.reshape(update * scale, variable.shape))


OPTIMIZERS = {"adam": WatchedAdam, "muon": WatchedMuon}
"""Optimisers by the name that a schedule gives them."""


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
    """Return the norms of a watched optimiser, also if a `LossScale` wraps it."""
    return getattr(optimizer, "inner_optimizer", optimizer).norms
