"""The eight classes (bins) of ExponentNet: from the exponent to its class and back.

The paper's figure with the ranges is lost. Equal widths of 0.375 decades of s, from 1 to 1000,
reproduce four rows of its Table 1 (docs/explanation/decisions.md).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lime_keras.optics.namespace import namespace

BIN_COUNT = 8
LOG_LOW, LOG_HIGH = 0.0, 3.0
BIN_WIDTH = (LOG_HIGH - LOG_LOW) / BIN_COUNT  # width of a bin in decades of s
LOG_EDGES = np.linspace(LOG_LOW, LOG_HIGH, BIN_COUNT + 1)
LOG_MEANS = (LOG_EDGES[:-1] + LOG_EDGES[1:]) / 2
"""Mean of log10 s inside each bin: the value that a class stands for."""

QUANTISATION_FLOOR = BIN_WIDTH / 4
"""Quantisation error: mean |Δ log10 s| of a perfect classifier, s log-uniform, 0.094."""


def bin_of(exponent: Any) -> np.ndarray:
    """Return the class 0…7, int32, of exponents of any shape.

    Exponents below 1 belong to the first class, exponents above 1000 to the last.

    Raises:
        ValueError: if an exponent is negative or NaN.

    Example:
        >>> bin_of([1, 2, 30, 1000]).tolist()
        [0, 0, 3, 7]
    """
    exponent = np.asarray(exponent, np.float64)
    if not np.all(exponent >= 0):
        raise ValueError(f"exponents must be at least 0, got {exponent.min()}: check the material")
    return bin_of_log(log_of(exponent)).astype(np.int32)


def log_of(exponent: Any) -> Any:
    """Return log10 s of any shape, array or tensor; exponents below 1 count as 1."""
    xp = namespace(exponent)
    return xp.log10(xp.maximum(exponent, 10.0**LOG_LOW))


def bin_of_log(log: Any) -> Any:
    """Return the class 0…7 of log10 s of any shape, array or tensor, as whole floats."""
    xp = namespace(log)
    # The slack of 1e-6 bins is for float32: without it 10**0.375, read back from a record, falls
    # below its own edge.
    return xp.clip(xp.floor((log - LOG_LOW) / BIN_WIDTH + 1e-6), 0, BIN_COUNT - 1)


def bin_label(k: int) -> str:
    """Return the range of exponents of class `k` as text, such as "s 13.3–31.6"."""
    low, high = np.round(10.0 ** LOG_EDGES[k : k + 2], 1)
    return f"s {low:g}–{high:g}"


def log_expected(probabilities: Any) -> Any:
    """Return the expected log10 s `(...)`, 0.19…2.81, of probabilities `(..., 8)` that sum to 1.

    Example:
        A network that cannot tell answers the middle of the range, s = 10^1.5:

        >>> round(float(log_expected(np.full(8, 1 / 8))), 3)
        1.5
    """
    xp = namespace(probabilities)
    return xp.sum(probabilities * LOG_MEANS.astype("float32"), axis=-1)


def log_of_outputs(outputs: Mapping[str, Any]) -> Any:
    """Return log10 s `(...)` of a system's outputs, NumPy arrays or tensors.

    Args:
        outputs: `log_exponent` `(..., 1)`, or `exponent_bin_probabilities` `(..., 8)`, of which
            the expected value is taken.
    """
    if "log_exponent" in outputs:
        return outputs["log_exponent"][..., 0]
    return log_expected(outputs["exponent_bin_probabilities"])


def entropy(probabilities: np.ndarray) -> np.ndarray:
    """Return the entropy `(...)` in bits of probabilities `(..., 8)` that sum to 1.

    The entropy is 0 for a certain class and 3 if all classes are equally likely.

    Example:
        >>> entropy(np.full(8, 1 / 8)).item()
        3.0
    """
    safe = np.where(probabilities > 0, probabilities, 1.0)
    return -np.sum(probabilities * np.log2(safe), axis=-1)
