"""The calibration of the exponent's class probabilities: the expected calibration error."""

import numpy as np

BINS = 10
"""Number of equal bins of confidence in [0, 1]; confidence is the winning class's probability."""
GAPS = tuple(f"calibration_{k}" for k in range(BINS))  # names of the columns of `gaps`


def gaps(probabilities: np.ndarray, right: np.ndarray) -> dict[str, np.ndarray]:
    """Return columns whose means m give the expected calibration error Σ|m|.

    Args:
        probabilities: class probabilities `(N, 8)`, each row summing to 1.
        right: whether the winning class is the true one, `(N,)`.

    Returns:
        `calibration_0` … `calibration_9`, `(N,)` each: confidence − right for the examples whose
        confidence lies in that bin, 0 for all others. Confidence 1 belongs to the last bin.
    """
    confidence = np.max(probabilities, axis=-1).astype(np.float64)
    chosen = np.minimum((confidence * BINS).astype(int), BINS - 1)
    gap = confidence - right
    return {name: np.where(chosen == k, gap, 0.0) for k, name in enumerate(GAPS)}
