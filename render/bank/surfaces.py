"""The two surfaces that a pixel sees at an edge or a crease.

The samples of such a pixel are parted by their mirror directions, into two groups that each vary
little (2-means). A single normal for the whole pixel gives D, S and M with errors of 24, 30 to 80
and 90 % in one pixel of twenty; two give 3, 6 to 20 and 27 % (`benchmarks/synthesis.py`).
"""

from typing import NamedTuple

import numpy as np

from lime_keras.optics.shading import reflect

from ..scene.gbuffer import GBuffer

PARTED_ABOVE = 2.0**-8
"""Variance of a pixel's mirror directions above which it has two surfaces."""
_ROUNDS = 3


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
    rows = np.flatnonzero(gbuffer.spread > PARTED_ABOVE)
    place = np.full(gbuffer.coverage.size, -1)
    place[gbuffer.covered_pixels[rows]] = np.arange(len(rows))
    owner = place[gbuffer.pixel]
    inside = owner >= 0
    owner, normal = owner[inside], gbuffer.normal[inside].astype(float)
    mirrored = reflect(normal, gbuffer.view[inside].astype(float))
    count = np.bincount(owner, minlength=len(rows))

    def means(vectors: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Return the mean vectors of both groups, `(2, K, 3)`; 0 for an empty group."""
        sums = [
            [np.bincount(owner, vectors[:, k] * group, len(rows)) for k in range(3)]
            for group in (first, ~first)
        ]
        ones = np.bincount(owner, first, len(rows))
        counts = np.stack([ones, count - ones])
        return np.moveaxis(np.array(sums), 1, -1) / np.maximum(counts, 1)[..., None]

    # Each group begins with one sample: the farthest from the mean, and the farthest from that one.
    whole = means(mirrored, np.ones(len(owner), bool))[0]
    middles = np.empty((2, len(rows), 3))
    middles[0] = mirrored[_farthest(owner, mirrored, whole)]
    middles[1] = mirrored[_farthest(owner, mirrored, middles[0])]
    first = np.ones(len(owner), bool)
    for _ in range(_ROUNDS):
        distance = [((mirrored - middle[owner]) ** 2).sum(axis=1) for middle in middles]
        first = distance[0] <= distance[1]
        middles = means(mirrored, first)
    normals = means(normal, first)
    share = np.bincount(owner, first, len(rows)) / np.maximum(count, 1)
    kept = (share > 0) & (share < 1) & (np.linalg.norm(normals, axis=-1) > 1e-3).all(axis=0)
    variance = np.clip(1 - (middles**2).sum(axis=-1), 0, 1)
    return Surfaces(rows[kept], share[kept], normals[:, kept], variance[:, kept])


def _farthest(owner: np.ndarray, vectors: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Return for each of K centres the index of its owned vector that lies farthest from it."""
    distance = ((vectors - centres[owner]) ** 2).sum(axis=1)
    order = np.argsort(distance, kind="stable")
    out = np.zeros(len(centres), int)
    out[owner[order]] = order
    return out
