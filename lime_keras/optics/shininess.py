"""Exponent to bin and back: the eight classes of ExponentNet.

The paper's figure with the ranges is lost; equal widths of 0.375 decades in log10 s from 1 to 1000
reproduce four rows of its Table 1 (docs/decisions.md).
"""

from typing import Any

import numpy as np

from lime_keras.arrays import namespace

BIN_COUNT = 8
LOG_LOW, LOG_HIGH = 0.0, 3.0
BIN_WIDTH = (LOG_HIGH - LOG_LOW) / BIN_COUNT
"""Width of a bin in decades of s."""
LOG_EDGES = np.linspace(LOG_LOW, LOG_HIGH, BIN_COUNT + 1)
LOG_MEANS = (LOG_EDGES[:-1] + LOG_EDGES[1:]) / 2
"""What each class stands for: the mean of log10 s inside its bin."""

QUANTISATION_FLOOR = BIN_WIDTH / 4
"""Mean |Δ log10 s| of a perfect classifier, for s log-uniform inside its bin: 0.094."""
CHANCE_LOG_ERROR = (LOG_HIGH - LOG_LOW) / 4
"""Mean |Δ log10 s| of always answering the middle: 0.75."""


def bin_of(exponent: Any) -> np.ndarray:
    """Class index 0…7 of exponents of any shape; those beyond 1…1000 go to the end bins.

    Raises:
        ValueError: if an exponent is negative or NaN.
    """
    exponent = np.asarray(exponent, np.float64)
    if not np.all(exponent >= 0):
        raise ValueError(f"exponents must be at least 0, got {exponent.min()}: check the material")
    return bin_of_log(np.log10(np.maximum(exponent, 10.0**LOG_LOW))).astype(np.int32)


def bin_of_log(log: Any) -> Any:
    """Class index 0…7 of log10 s of any shape and either backend, as whole floating numbers."""
    xp = namespace(log)
    # Half an ulp of float32 slack, or 10**0.375 read back from a record falls below its own edge.
    return xp.clip(xp.floor((log - LOG_LOW) / BIN_WIDTH + 1e-6), 0, BIN_COUNT - 1)


def log_expected(probabilities: Any) -> Any:
    """Expected log10 s `(...)` of class probabilities `(..., 8)` that sum to 1."""
    xp = namespace(probabilities)
    return xp.sum(probabilities * LOG_MEANS.astype("float32"), axis=-1)


def log_winning(probabilities: np.ndarray) -> np.ndarray:
    """log10 s `(...)` that the most probable class stands for."""
    return LOG_MEANS[np.argmax(probabilities, axis=-1)]


def entropy(probabilities: np.ndarray) -> np.ndarray:
    """Entropy of `(..., 8)` probabilities in bits: 0 is certain, 3 knows nothing."""
    safe = np.where(probabilities > 0, probabilities, 1.0)
    return -np.sum(probabilities * np.log2(safe), axis=-1)
