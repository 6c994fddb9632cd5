"""The precisions in which plain functions are tried, and the tolerance of each."""

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import tensorflow as tf

from lime_keras.eval.stability import precisions as of_systems
from lime_keras.eval.stability.precisions import ROUNDINGS
from lime_keras.eval.stability.verdicts import Compared


@dataclass(frozen=True)
class Precision(of_systems.Precision):
    """A number format, and the library that computes in it.

    Attributes:
        least: magnitude below which numbers lose digits or become 0.
        largest: largest finite number.
        tensors: whether Keras computes; otherwise NumPy does.
    """

    least: float
    largest: float
    tensors: bool = True

    def rounded(self, values: Any) -> np.ndarray:
        """Round numbers to the format, and return them in double precision."""
        with np.errstate(over="ignore"):
            return self.array(values).astype(np.float64)

    def array(self, values: Any) -> np.ndarray:
        """Convert numbers to an array of the format."""
        with np.errstate(over="ignore"):
            return np.asarray(values, np.float64).astype(tf.as_dtype(self.dtype).as_numpy_dtype)

    def holds(self, value: float) -> bool:
        """Return whether rounding to the format keeps a number from becoming 0 or infinite."""
        kept = float(self.rounded(value))
        return bool(np.isfinite(kept) == np.isfinite(value) and (kept == 0) == (value == 0))

    def tolerance(self, magnitude: Any, terms: int = 1) -> Any:
        """Return the largest error that rounding explains in a sum of `terms` formulas.

        Args:
            magnitude: sum of the rounded values' magnitudes, each times its condition number.
            terms: number of terms; rounding errors of a sum grow with its square root.
        """
        units = ROUNDINGS + np.sqrt(terms)
        return units * (self.epsilon * np.abs(magnitude) + self.least)

    def compare(
        self, found: Any, low: Any, high: Any, magnitude: Any, *, terms: int = 1
    ) -> Compared:
        """Compare numbers with references.

        Infinity is also correct where the reference exceeds the format's range. The arguments are
        those of `Compared` and `tolerance`.
        """
        low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
        with np.errstate(invalid="ignore"):
            least = np.where(low < -self.largest, -np.inf, np.minimum(low, self.largest))
            most = np.where(high > self.largest, np.inf, np.maximum(high, -self.largest))
        # Where the reference itself is infinite, the result must be infinite.
        low, high = np.where(np.isposinf(low), low, least), np.where(np.isneginf(high), high, most)
        return Compared(found, low, high, self.tolerance(magnitude, terms))

    def value(self, function: Callable[..., Any], *values: Any) -> np.ndarray:
        """Compute a function of tensors in this precision; return its value in float64."""
        run = _compiled(function) if self.compiled else function
        return _double(run(*(tf.constant(self.array(value)) for value in values)))

    def evaluate(
        self, function: Callable[..., Any], *values: Any
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Compute a function in this precision, and the gradients of its sum by each argument.

        Returns:
            The value and the list of gradients in float64; the list is empty for NumPy.
        """
        arrays = [self.array(value) for value in values]
        if not self.tensors:
            with np.errstate(all="ignore"):
                return np.asarray(function(*arrays), np.float64), []
        run = _differentiated(function, self.compiled)
        value, gradients = run(*map(tf.constant, arrays))
        return _double(value), [_double(gradient) for gradient in gradients]


_LARGEST = float(np.finfo(np.float32).max)
SINGLE = Precision(**vars(of_systems.SINGLE), least=2.0**-126, largest=_LARGEST)
# TensorFlow's kernels keep subnormal numbers of float16, and flush those of the others to 0.
HALF = Precision(**vars(of_systems.HALF), least=2.0**-24, largest=65504.0)
BRAIN = Precision(**vars(of_systems.BRAIN), least=2.0**-126, largest=(2 - 2.0**-7) * 2.0**127)
XLA = Precision(**vars(of_systems.XLA), least=2.0**-126, largest=_LARGEST)
TENSORS = (SINGLE, HALF, BRAIN, XLA)  # precisions in which functions of `keras.ops` are tried

NUMPY_SINGLE = replace(SINGLE, name="NumPy float32", tensors=False)
NUMPY_DOUBLE = Precision(
    "NumPy float64", "float64", 2.0**-52, 2.0**-1022, float(np.finfo(float).max), tensors=False
)
ARRAYS = (NUMPY_SINGLE, NUMPY_DOUBLE)  # precisions in which functions of NumPy are tried


@functools.cache
def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function compiled by XLA, which compiles it once for each shape."""
    return tf.function(function, jit_compile=True)


@functools.cache
def _differentiated(function: Callable[..., Any], compiled: bool) -> Callable[..., Any]:
    """Return a function that computes the given one's value and its gradients."""

    def run(*variables: tf.Tensor) -> tuple[tf.Tensor, list[tf.Tensor]]:
        with tf.GradientTape() as tape:
            tape.watch(variables)
            value = function(*variables)
        return value, tape.gradient(
            value, variables, unconnected_gradients=tf.UnconnectedGradients.ZERO
        )

    return _compiled(run) if compiled else run


def _double(tensor: tf.Tensor) -> np.ndarray:
    return np.asarray(tensor).astype(np.float64)
