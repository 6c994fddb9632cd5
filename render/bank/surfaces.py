"""The two surfaces that a pixel sees at an edge or a crease.

The samples of such a pixel are parted by their mirror directions, into two groups that each vary
little (2-means). A single normal for the whole pixel gives D, S and M with errors of 24, 30 to 80
and 90 % in one pixel of twenty; two give 3, 6 to 20 and 27 % (`benchmarks/synthesis_error.py`).
"""

from typing import NamedTuple

import numpy as np

from ..scene.gbuffer import GBuffer

PARTED_ABOVE = 2.0**-8
"""Variance of a pixel's mirror directions above which it has two surfaces."""
_ROUNDS = 3
_LEAST_LENGTH = 1e-3  # of a mean normal; a shorter one has no direction


class Surfaces(NamedTuple):
    """The parted pixels of a G-buffer.

    Attributes:
        rows: places of the parted pixels among the covered pixels, `(K,)`.
        share: share of each pixel's samples in its first group, above 0 and below 1, `(K,)`.
        normal: mean normal of the samples of both groups, `(2, K, 3)`, not zero.
        variance: variance of the mirror directions in both groups, 0 … 1, `(2, K)`.
    """

    rows: np.ndarray
    share: np.ndarray
    normal: np.ndarray
    variance: np.ndarray


def parted(gbuffer: GBuffer) -> Surfaces:
    """Part the samples of the pixels that see an edge or a crease.

    Pixels whose samples have all the same mirror direction, or a group without a mean normal, stay
    whole.
    """
    # The samples of a covered pixel follow one another, in the order of the covered pixels.
    counts = np.diff(np.flatnonzero(np.diff(gbuffer.pixel, prepend=-1)), append=len(gbuffer.pixel))
    rough = gbuffer.spread > PARTED_ABOVE
    rows, counts, inside = np.flatnonzero(rough), counts[rough], np.repeat(rough, counts)
    if not len(rows):
        return Surfaces(rows, np.zeros(0), np.zeros((2, 0, 3)), np.zeros((2, 0)))
    begins = np.cumsum(counts) - counts
    normal = gbuffer.normal[inside].T.astype(np.float64, order="C")
    view = gbuffer.view[inside].T.astype(np.float64, order="C")
    mirrored = 2 * (normal * view).sum(axis=0) * normal - view

    def means(vectors: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Return the mean vectors of both groups, `(2, 3, K)`; 0 for an empty group."""
        ones = np.add.reduceat(first, begins, dtype=np.int64)
        sums = np.add.reduceat(vectors * first, begins, axis=1)
        others = np.add.reduceat(vectors * ~first, begins, axis=1)
        return np.stack([sums / np.maximum(ones, 1), others / np.maximum(counts - ones, 1)])

    def farthest(middle: np.ndarray) -> np.ndarray:
        """Return of each pixel the mirror direction farthest from its `middle`, `(3, K)`."""
        distance = ((mirrored - np.repeat(middle, counts, axis=1)) ** 2).sum(axis=0)
        most = np.maximum.reduceat(distance, begins)
        reached = np.flatnonzero(distance == np.repeat(most, counts))
        return mirrored[:, reached[np.searchsorted(reached, begins)]]

    # Each group begins with one sample: the farthest from the mean, and the farthest from that one.
    one = farthest(np.add.reduceat(mirrored, begins, axis=1) / counts)
    middles = np.stack([one, farthest(one)])
    first = np.ones(len(mirrored[0]), bool)
    for _ in range(_ROUNDS):
        # Nearer to the first middle: beyond the plane halfway between the two.
        apart = middles[0] - middles[1]
        halfway = (apart * (middles[0] + middles[1])).sum(axis=0) / 2
        first = (mirrored * np.repeat(apart, counts, axis=1)).sum(axis=0) >= np.repeat(
            halfway, counts
        )
        middles = means(mirrored, first)
    normals = means(normal, first)
    share = np.add.reduceat(first, begins, dtype=np.int64) / counts
    kept = (share > 0) & (share < 1) & (np.linalg.norm(normals, axis=1) > _LEAST_LENGTH).all(axis=0)
    variance = np.clip(1 - (middles**2).sum(axis=1), 0, 1)
    return Surfaces(rows[kept], share[kept], normals[:, :, kept].swapaxes(1, 2), variance[:, kept])
