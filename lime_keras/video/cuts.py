"""Scene cuts, by how far apart the colours of successive frames lie.

Colours stay while an object turns or the camera moves about it, and change where another scene
begins. A cut to a scene of the same colours, one thing put in another's place, is not noticed; nor
is a slow cross-fade.
"""

import numpy as np

THRESHOLD = 0.25
"""Distance of two frames from which a cut may lie between them: that of rendered scenes, between
cuts, stays below an eighth of it (`benchmarks/temporal.py`), and a step of a third of a stop in the
camera's exposure below it."""
_STANDS_OUT = 2.0
"""A cut is so many times the distance before it: in a fast pan or a fade all are large."""
_BINS = 16
_ACROSS = 64
"""Pixels looked at along either side, at least: a colour histogram needs no more."""


class CutDetector:
    """Tells, frame by frame, where a new scene begins."""

    def __init__(self) -> None:
        self._last: np.ndarray | None = None
        self._before = 0.0

    def is_cut(self, image_srgb: np.ndarray) -> bool:
        """Whether a cut lies between the last frame and this one, never before the first.

        Args:
            image_srgb: `(H, W, 3)` uint8, of any size.
        """
        last, self._last = self._last, histogram(image_srgb)
        before, self._before = self._before, 0.0 if last is None else distance(last, self._last)
        return self._before > max(THRESHOLD, _STANDS_OUT * before)


def histogram(image_srgb: np.ndarray) -> np.ndarray:
    """How often each level of each channel occurs, `(3, 16)`, each row summing to 1.

    A level counts in the two bins around it by its nearness. In plain bins a wall whose level lies
    at a bin's edge would cross it, all at once, with the camera's noise.

    Args:
        image_srgb: `(H, W, 3)` uint8.
    """
    height, width, _ = image_srgb.shape
    small = image_srgb[:: max(1, height // _ACROSS), :: max(1, width // _ACROSS)].reshape(-1, 3)
    position = small * ((_BINS - 1) / 255.0)
    lower = np.minimum(position.astype(np.int64), _BINS - 2)
    upper_share = position - lower
    counts = [
        np.bincount(at, 1 - share, _BINS) + np.bincount(at + 1, share, _BINS)
        for at, share in zip(lower.T, upper_share.T, strict=True)
    ]
    return np.stack(counts) / len(small)


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """Share of the pixels, in [0, 1], whose level differs: that of the channel that differs most.

    Args:
        one: `(3, 16)` of `histogram`.
        other: likewise.
    """
    return float(np.max(np.sum(np.abs(one - other), axis=1)) / 2)
