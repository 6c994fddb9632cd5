"""Words for what tables and reports show."""

import numpy as np

from lime_keras.optics import shininess


def bin_label(k: int) -> str:
    """The exponents of class `k`, such as "s 13.3–31.6"."""
    low, high = np.round(10.0 ** shininess.LOG_EDGES[k : k + 2], 1)
    return f"s {low:g}–{high:g}"
