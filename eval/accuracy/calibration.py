"""The calibration of the exponent's class probabilities: reliability of the winning class."""

import numpy as np

BINS = 10
"""Number of equal bins of confidence in [0, 1]; confidence is the winning class's probability."""


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


def reliability(
    probabilities: np.ndarray, right: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return, by bin of confidence, how many examples there are and how often they are right.

    Arguments are those of `gaps`.

    Returns:
        The number of examples, their mean confidence, and the share of correct winning classes,
        `(10,)` each; the last two are NaN in a bin without examples.
    """
    confidence, chosen = _binned(probabilities)
    count = np.bincount(chosen, minlength=BINS)
    # An empty bin gives NaN, without a warning.
    each = np.where(count > 0, count, np.nan)
    sums = (np.bincount(chosen, x, BINS) for x in (confidence, np.asarray(right, np.float64)))
    mean_confidence, mean_right = (total / each for total in sums)
    return count, mean_confidence, mean_right


def _binned(probabilities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the confidence `(N,)` and its bin `(N,)`; confidence 1 belongs to the last bin."""
    confidence = np.max(probabilities, axis=-1).astype(np.float64)
    return confidence, np.minimum((confidence * BINS).astype(int), BINS - 1)
