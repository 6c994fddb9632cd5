"""The words with which tables and reports describe classes and exponents."""

import numpy as np

from lime_keras.networks import Architecture
from lime_keras.optics import shininess


def bin_label(k: int) -> str:
    """Return the range of exponents of class `k` as text, such as "s 13.3–31.6"."""
    low, high = np.round(10.0 ** shininess.LOG_EDGES[k : k + 2], 1)
    return f"s {low:g}–{high:g}"


def exponent(architecture: Architecture) -> str:
    """Return how log10 s and its bin are computed from the system's outputs, in words."""
    if architecture.exponent == "regression":
        return "the system answers log10 s itself; its bin is the one that s falls into"
    return "log10 s is the expected value over the eight classes, or that of the winning bin"
