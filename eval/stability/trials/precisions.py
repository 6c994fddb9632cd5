"""The precisions in which the library's parts are tried, and what each may err by."""

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import tensorflow as tf

from .verdicts import Compared

ROUNDINGS = 8
"""Units in the last place that a formula of a line or two may lose, for each unit of condition:
four operations that round, and two library functions, which err by up to two units each."""


@dataclass(frozen=True)
class Precision:
    """A number format and what computes in it.

    Attributes:
        name: as in the table.
        dtype: name of the format.
        epsilon: distance from 1 to the next number.
        least: below this, numbers lose their digits or become 0.
        largest: finite number.
        tensors: whether Keras computes, not NumPy.
        compiled: whether XLA compiles what Keras computes.
    """

    name: str
    dtype: str
    epsilon: float
    least: float
    largest: float
    tensors: bool = True
    compiled: bool = False

    def rounded(self, values: Any) -> np.ndarray:
        """What the format makes of numbers, in double precision."""
        with np.errstate(over="ignore"):
            return self.array(values).astype(np.float64)

    def array(self, values: Any) -> np.ndarray:
        """Numbers in the format."""
        with np.errstate(over="ignore"):
            return np.asarray(values, np.float64).astype(tf.as_dtype(self.dtype).as_numpy_dtype)

    def holds(self, value: float) -> bool:
        """Whether the format tells a number from 0 and from infinity."""
        kept = float(self.rounded(value))
        return bool(np.isfinite(kept) == np.isfinite(value) and (kept == 0) == (value == 0))

    def tolerance(self, magnitude: Any, terms: int = 1) -> Any:
        """The largest error of a sum of `terms` formulas.

        Args:
            magnitude: of what is rounded: values times their condition, added up.
            terms: a sum's rounding errors grow with the square root of their number.
        """
        units = ROUNDINGS + np.sqrt(terms)
        return units * (self.epsilon * np.abs(magnitude) + self.least)

    def compare(
        self, found: Any, low: Any, high: Any, magnitude: Any, *, terms: int = 1
    ) -> Compared:
        """Numbers beside references; of one beyond the format's range, infinity is right too.

        Arguments as of `Compared` and `tolerance`.
        """
        low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
        with np.errstate(invalid="ignore"):
            least = np.where(low < -self.largest, -np.inf, np.minimum(low, self.largest))
            most = np.where(high > self.largest, np.inf, np.maximum(high, -self.largest))
        # What is itself infinite must come out so.
        low, high = np.where(np.isposinf(low), low, least), np.where(np.isneginf(high), high, most)
        return Compared(found, low, high, self.tolerance(magnitude, terms))

    def value(self, function: Callable[..., Any], *values: Any) -> np.ndarray:
        """What a function of tensors answers."""
        run = _compiled(function) if self.compiled else function
        return _double(run(*(tf.constant(self.array(value)) for value in values)))

    def evaluate(
        self, function: Callable[..., Any], *values: Any
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """A function's value, and the gradients of its sum by each argument; NumPy has none."""
        arrays = [self.array(value) for value in values]
        if not self.tensors:
            with np.errstate(all="ignore"):
                return np.asarray(function(*arrays), np.float64), []
        run = _differentiated(function, self.compiled)
        value, gradients = run(*map(tf.constant, arrays))
        return _double(value), [_double(gradient) for gradient in gradients]


SINGLE = Precision("float32", "float32", 2.0**-23, 2.0**-126, float(np.finfo(np.float32).max))
# TensorFlow's kernels keep float16's subnormals, and flush those of the wider exponents.
HALF = Precision("float16", "float16", 2.0**-10, 2.0**-24, 65504.0)
BRAIN = Precision("bfloat16", "bfloat16", 2.0**-7, 2.0**-126, (2 - 2.0**-7) * 2.0**127)
XLA = replace(SINGLE, name="XLA float32", compiled=True)
TENSORS = (SINGLE, HALF, BRAIN, XLA)
"""What is written in `keras.ops` is tried in these."""

NUMPY_SINGLE = replace(SINGLE, name="NumPy float32", tensors=False)
NUMPY_DOUBLE = Precision(
    "NumPy float64", "float64", 2.0**-52, 2.0**-1022, float(np.finfo(float).max), tensors=False
)
ARRAYS = (NUMPY_SINGLE, NUMPY_DOUBLE)
"""What is written in NumPy is tried in these."""


@functools.cache
def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """By XLA, once for each shape."""
    return tf.function(function, jit_compile=True)


@functools.cache
def _differentiated(function: Callable[..., Any], compiled: bool) -> Callable[..., Any]:
    """The function with its gradients."""

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
