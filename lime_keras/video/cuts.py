"""Scene cuts, detected by the distance between the colour histograms of successive frames.

The colours stay nearly the same while an object turns or the camera moves around it. They change
when another scene begins. A cut to a scene of the same colours, such as an exchange of one object,
is not detected; neither is a slow cross-fade.
"""

import numpy as np

THRESHOLD = 0.25
"""Distance of two frames, in [0, 1], above which a cut may lie between them.

In rendered scenes the distance between cuts stays below a quarter of this threshold
(`benchmarks/temporal.py`). After a step of a third of a stop in the camera's exposure it stays
below the threshold.
"""
_STANDS_OUT = 2.0
"""Least ratio of a cut's distance to the distance before it; in a fast pan all are large."""
_BINS = 16
_ACROSS = 64
"""Smallest number of pixels counted along a side of a larger frame: enough for a histogram."""


class CutDetector:
    """A detector of scene cuts, fed frame by frame."""

    def __init__(self) -> None:
        self._last: np.ndarray | None = None
        self._before = 0.0

    def is_cut(self, image_srgb: np.ndarray) -> bool:
        """Return whether a cut lies between the last frame and this frame; False for the first.

        Args:
            image_srgb: frame `(H, W, 3)`, uint8 sRGB, of any size.
        """
        last, self._last = self._last, histogram(image_srgb)
        before, self._before = self._before, 0.0 if last is None else distance(last, self._last)
        return self._before > max(THRESHOLD, _STANDS_OUT * before)


def histogram(image_srgb: np.ndarray) -> np.ndarray:
    """Return the colour histogram `(3, 16)` of an image, each channel's row summing to 1.

    Each level is shared between the two nearest bins, by its distance to them. With plain bins, the
    camera's noise could move a whole wall from one bin to the next.

    Args:
        image_srgb: `(H, W, 3)`, uint8 sRGB.
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
    """Return the share of pixels, in [0, 1], by which two histograms `(3, 16)` differ.

    The share is the largest of the three channels' shares.
    """
    return float(np.max(np.sum(np.abs(one - other), axis=1)) / 2)
