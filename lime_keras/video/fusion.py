"""Temporal fusion of the estimates of a video's frames (paper, section 5.5 and Eq. 6).

An estimate first passes a median over the last five frames, which drops outliers, then the decaying
average P̂_t = α P_t + (1 − α) P̂_{t−1} with α = 1/t, which is the mean of all medians so far: t
counts the frames since the last scene cut, where the caller restarts.
"""

import numpy as np

WINDOW = 5
"""Frames of the median (section 5.5)."""


class Fusion:
    """Fuses the estimates of one thing, an array of any shape, over frames.

    Every element is fused by itself. One that is NaN was not seen in that frame and takes no part:
    its median reaches back to its own last five sightings, its t counts these alone, and it keeps
    its fused value meanwhile. So an environment map whose texels come into view one by one is fused
    by the same rule as a frame in which no object was found, which is all NaN or never passed.

    All is kept in float64: with t in the millions a step of 1/t is below float32's resolution.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget everything, as after a scene cut; the next estimate may have another shape."""
        self._recent: np.ndarray | None = None

    @property
    def fused(self) -> np.ndarray | None:
        """The fused estimate, NaN where nothing was ever seen; None before the first estimate."""
        if self._recent is None:
            return None
        return np.where(self._sightings > 0, self._average, np.nan)

    def update(self, estimate: np.ndarray | float) -> np.ndarray:
        """Fuse the next frame's estimate.

        Args:
            estimate: of any shape, the same until a restart; NaN where nothing was seen. Pass what
                may be averaged: log10 of an exponent, linear radiance.

        Returns:
            The fused estimate, float64 and of the same shape, NaN where nothing was ever seen.

        Raises:
            ValueError: if the shape changes between restarts, or an element is infinite.
        """
        new = np.asarray(estimate, np.float64)
        if np.any(np.isinf(new)):
            raise ValueError(
                f"an estimate is finite, or NaN where nothing was seen, but {np.sum(np.isinf(new))}"
                f" of {new.size} elements are infinite: pass them as NaN to leave them out"
            )
        if self._recent is None:
            self._recent = np.full((WINDOW, *new.shape), np.nan)
            self._sightings = np.zeros(new.shape, np.int64)
            self._average = np.zeros(new.shape)
        if new.shape != self._average.shape:
            raise ValueError(
                f"estimates since the restart have shape {self._average.shape}, got {new.shape}: "
                "restart first, or fuse each thing by a Fusion of its own"
            )
        seen = ~np.isnan(new)
        shifted = np.concatenate([new[None], self._recent[:-1]])
        self._recent = np.where(seen, shifted, self._recent)
        self._sightings = self._sightings + seen
        medians = np.where(seen, _median(self._recent, self._sightings), self._average)
        self._average = decayed(self._average, medians, np.maximum(self._sightings, 1))
        return np.where(self._sightings > 0, self._average, np.nan)


def decayed(average: np.ndarray, value: np.ndarray, t: np.ndarray | int) -> np.ndarray:
    """Eq. 6 with α = 1/t: the average of t values, from that of t − 1 and the t-th.

    Written as a step from the average towards the value, so that a value that equals the average
    leaves it exactly as it is however often it comes.
    """
    return average + (value - average) / t


def _median(recent: np.ndarray, sightings: np.ndarray) -> np.ndarray:
    """Median over the first axis of `(WINDOW, ...)`, of as many values as there are; else NaN."""
    ordered = np.sort(recent, axis=0)  # NaN comes last
    count = np.clip(sightings, 1, WINDOW)
    lower, upper = np.take_along_axis(ordered, np.stack([(count - 1) // 2, count // 2]), axis=0)
    return 0.5 * lower + 0.5 * upper
