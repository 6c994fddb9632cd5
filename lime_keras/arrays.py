"""Array helpers: what to compute with, NumPy or Keras, and the type of a loaded model."""

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
