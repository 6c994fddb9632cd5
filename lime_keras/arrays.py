"""What arrays are passed through: one formula for NumPy and Keras alike, and loaded models."""

from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

import numpy as np

Answer = Callable[[np.ndarray], Mapping[str, np.ndarray]]
"""From images `(B, S, S, 3)` sRGB in [0, 1] to the outputs of `lime_keras.networks.assemble`."""


def namespace(*values: Any) -> ModuleType:
    """Return the module whose functions suit `values`: `numpy`, or else `keras.ops`.

    Keras is imported only when a tensor is passed, so the renderer's workers never need it.
    """
    plain = np.ndarray | np.generic | float | int | list | tuple
    if all(isinstance(value, plain) for value in values):
        return np
    from keras import ops

    return ops
