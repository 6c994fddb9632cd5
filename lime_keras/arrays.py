"""Array helpers: what to compute with, NumPy or Keras, splines, the type of a loaded model."""

import functools
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

import numpy as np

Predict = Callable[[np.ndarray], Mapping[str, np.ndarray]]
"""A loaded model: maps images `(B, S, S, 3)`, sRGB in [0, 1], to outputs by name.

The outputs are those of `lime_keras.networks.assemble`.
"""


def namespace(*values: Any) -> ModuleType:
    """Return the module to compute with: `numpy` for plain values, `keras.ops` for tensors.

    Keras is imported only if one of `values` is a tensor, so the renderer's workers never need it.
    """
    plain = np.ndarray | np.generic | float | int | list | tuple
    if all(isinstance(value, plain) for value in values):
        return np
    from keras import ops

    return ops


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of Keras tensors, compiled by XLA under Keras' backend.

    It is compiled anew for arguments of other shapes.
    """
    from keras.backend import backend

    if backend() == "tensorflow":
        import tensorflow as tf

        return tf.function(function, jit_compile=True, autograph=False)
    import jax

    return jax.jit(function)


@functools.lru_cache(64)
def spline_weights(count: int, size: int) -> np.ndarray:
    """Return the weights `(size, count)` float32 of uniform cubic B-splines, for each pixel.

    The outermost of `count` nodes, at least 4, lie outside of the image.
    """
    position = np.linspace(1, count - 2, size)[:, None]
    d = np.abs(position - np.arange(count))
    near = 2 / 3 - d**2 + d**3 / 2
    return np.where(d < 1, near, np.maximum(2 - d, 0) ** 3 / 6).astype(np.float32)
