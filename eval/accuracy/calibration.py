"""The calibration of the exponent's class probabilities: reliability of the winning class."""

from dataclasses import dataclass

import numpy as np

BINS = 10
"""Number of equal bins of confidence in [0, 1]; confidence is the winning class's probability."""


@dataclass(frozen=True)
class Reliability:
    """The reliability of the winning class in each bin of confidence.

    Attributes:
        count: number of examples `(10,)`.
        confidence: their mean confidence `(10,)`; NaN in a bin without examples.
        right: share of them whose winning class is the true one `(10,)`; NaN likewise.
    """

    count: np.ndarray
    confidence: np.ndarray
    right: np.ndarray


def gaps(probabilities: np.ndarray, right: np.ndarray) -> dict[str, np.ndarray]:
    """Return columns whose means m give the expected calibration error Σ|m|.

    Args:
        probabilities: class probabilities `(N, 8)`, each row summing to 1.
        right: whether the winning class is the true one, `(N,)`.

    Returns:
        `calibration_0` … `calibration_9`, `(N,)` each: confidence − right for the examples whose
        confidence lies in that bin, 0 for all others.
    """
    confidence, chosen = _binned(probabilities)
    gap = confidence - right
    return {name: np.where(chosen == k, gap, 0.0) for k, name in enumerate(GAPS)}


GAPS = tuple(f"calibration_{k}" for k in range(BINS))  # names of the columns of `gaps`


def reliability(probabilities: np.ndarray, right: np.ndarray) -> Reliability:
    """Return the share of correct winning classes by bin of confidence; arguments as in `gaps`."""
    confidence, chosen = _binned(probabilities)
    count = np.bincount(chosen, minlength=BINS)
    # An empty bin gives NaN, without a warning.
    each = np.where(count > 0, count, np.nan)
    return Reliability(
        count,
        np.bincount(chosen, confidence, BINS) / each,
        np.bincount(chosen, np.asarray(right, np.float64), BINS) / each,
    )


def _binned(probabilities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the confidence `(N,)` and its bin `(N,)`; confidence 1 belongs to the last bin."""
    confidence = np.max(probabilities, axis=-1).astype(np.float64)
    return confidence, np.minimum((confidence * BINS).astype(int), BINS - 1)
