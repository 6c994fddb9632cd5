"""What to compute with: NumPy or Keras."""

from types import ModuleType
from typing import Any

import numpy as np


def namespace(*values: Any) -> ModuleType:
    """Return the module to compute with: `numpy` for plain values, `keras.ops` for tensors.

    Keras is imported only if one of `values` is a tensor, so the renderer's workers never need it.
    """
    plain = np.ndarray | np.generic | float | int | list | tuple
    if all(isinstance(value, plain) for value in values):
        return np
    from keras import ops

    return ops
