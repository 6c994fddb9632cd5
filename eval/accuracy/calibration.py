"""Are the eight probabilities what they say? Reliability of the winning class."""

from dataclasses import dataclass

import numpy as np

BINS = 10
"""Of confidence, the winning class' probability, equally wide between 0 and 1."""


@dataclass(frozen=True)
class Reliability:
    """By bin of confidence, `(10,)` each: examples, their mean confidence, their share right.

    Where there are no examples, the two are NaN.
    """

    count: np.ndarray
    confidence: np.ndarray
    right: np.ndarray


def gaps(probabilities: np.ndarray, right: np.ndarray) -> dict[str, np.ndarray]:
    """Columns whose means m give the expected calibration error Σ|m|.

    Args:
        probabilities: `(N, 8)`, each row summing to 1.
        right: `(N,)`, whether the winning class is the true one.

    Returns:
        `calibration_0` … `calibration_9`, `(N,)` each: confidence − right of the examples whose
        confidence lies in that bin, 0 for all others.
    """
    confidence, chosen = _binned(probabilities)
    gap = confidence - right
    return {name: np.where(chosen == k, gap, 0.0) for k, name in enumerate(GAPS)}


GAPS = tuple(f"calibration_{k}" for k in range(BINS))
"""Names of the columns of `gaps`."""


def reliability(probabilities: np.ndarray, right: np.ndarray) -> Reliability:
    """How often the winning class is right, by how probable it was called; arguments as `gaps`."""
    confidence, chosen = _binned(probabilities)
    count = np.bincount(chosen, minlength=BINS)
    # NaN, without a warning, where a bin is empty.
    each = np.where(count > 0, count, np.nan)
    return Reliability(
        count,
        np.bincount(chosen, confidence, BINS) / each,
        np.bincount(chosen, np.asarray(right, np.float64), BINS) / each,
    )


def _binned(probabilities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Confidence `(N,)` of the winning class and its bin; 1 belongs to the last."""
    confidence = np.max(probabilities, axis=-1).astype(np.float64)
    return confidence, np.minimum((confidence * BINS).astype(int), BINS - 1)
