"""Temporal fusion of the estimates of a video's frames (paper, section 5.5 and Eq. 6).

An estimate first passes a median over the last five frames, which removes outliers. Then follows
the decaying average P̂_t = α P_t + (1 − α) P̂_{t−1} with α = 1/t, the mean of all medians so far.
t counts the frames since the last scene cut, after which the caller takes another `Fusion`.
"""

import numpy as np

WINDOW = 5  # number of frames in the median (section 5.5)


class Fusion:
    """The fusion of one quantity, an array of any shape, over the frames of a video.

    Every element is fused by itself. An element that is NaN was not seen in that frame, and keeps
    its fused value. Its median takes the last five frames in which it was seen, and its t counts
    only these frames. So one rule serves an environment map whose texels come into view one by one
    and a frame without an object, which is all NaN or is left out.

    All values are float64: with t in the millions, a step of 1/t is below float32's resolution.
    """

    def __init__(self) -> None:
        self._recent: np.ndarray | None = None

    def update(self, estimate: np.ndarray | float) -> np.ndarray:
        """Fuse the next frame's estimate.

        Args:
            estimate: array of any shape, always the same; NaN for elements not seen. Its values
                must be meaningful to average, such as log10 of an exponent or linear radiance.

        Returns:
            The fused estimate, float64 of the same shape, NaN for elements never seen.

        Raises:
            ValueError: if the shape changes, or an element is infinite.
        """
        new = np.asarray(estimate, np.float64)
        if np.any(np.isinf(new)):
            raise ValueError(
                f"an estimate is finite, or NaN where nothing was seen, but {np.sum(np.isinf(new))}"
                f" of {new.size} elements are infinite: pass them as NaN to leave them out"
            )
        if self._recent is None:
            self._recent = np.full((WINDOW, *new.shape), np.nan)
            self._observations = np.zeros(new.shape, np.int64)
            self._average = np.zeros(new.shape)
        observed = ~np.isnan(new)
        shifted = np.concatenate([new[None], self._recent[:-1]])
        self._recent = np.where(observed, shifted, self._recent)
        self._observations = self._observations + observed
        medians = np.where(observed, _median(self._recent, self._observations), self._average)
        self._average = decayed(self._average, medians, np.maximum(self._observations, 1))
        return np.where(self._observations > 0, self._average, np.nan)


def decayed(average: np.ndarray, value: np.ndarray, t: np.ndarray | int) -> np.ndarray:
    """Return the average of t values, given the average of the first t − 1 and the t-th value.

    This is Eq. 6 with α = 1/t, written as a step from the average towards the value. A value equal
    to the average then leaves the average exactly as it is.
    """
    return average + (value - average) / t


def _median(recent: np.ndarray, sightings: np.ndarray) -> np.ndarray:
    """Return the median over the first axis of `(WINDOW, ...)` without NaN; NaN if all are NaN."""
    ordered = np.sort(recent, axis=0)  # NaN comes last
    count = np.clip(sightings, 1, WINDOW)
    lower, upper = np.take_along_axis(ordered, np.stack([(count - 1) // 2, count // 2]), axis=0)
    return 0.5 * lower + 0.5 * upper
