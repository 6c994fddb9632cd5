"""One formula for NumPy arrays and Keras tensors alike."""

from types import ModuleType
from typing import Any

import numpy as np


def namespace(*values: Any) -> ModuleType:
    """Return the module whose functions suit `values`: `numpy`, or else `keras.ops`.

    Keras is imported only when a tensor is passed, so the renderer's workers never need it.
    """
    plain = np.ndarray | np.generic | float | int | list | tuple
    if all(isinstance(value, plain) for value in values):
        return np
    from keras import ops

    return ops
