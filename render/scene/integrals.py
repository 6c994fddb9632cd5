"""D, S and M at all samples of an image: fast, and tested against plain sums over every texel.

Directions are in the map's frame. For S, samples are grouped by mirror direction. A group shares
the lights of a `Light.cut`, without those behind the surface.
"""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from lime_keras.optics import environment, shading

from .lights import Light

Cut = tuple[slice, np.ndarray, np.ndarray]
"""A group of samples, with the directions `(T, 3)` and the energies `(T,)` of its lights."""

_LEAST_CELLS = 4  # fewest cells across the sphere into which mirror directions are sorted
_TOGETHER = 16
"""Number of groups whose lights are cut at once: few enough for the processor's cache."""


def diffuse(normal: np.ndarray, light: Light) -> np.ndarray:
    """Look up D(n), `(N,)`, for normals `(N, 3)` in the light's table."""
    return environment.lookup(light.diffuse_shading, normal)


def mirror(normal: np.ndarray, view: np.ndarray, light: Light, spacing: np.ndarray) -> np.ndarray:
    """Compute M(n, o), `(N,)`, from the map averaged over what lies between the samples.

    A lamp smaller than the distance of two mirror directions would else be seen or missed by
    chance. Looked up with texels as wide as that distance, bilinear, it counts once.

    Args:
        normal: n, unit, `(N, 3)`.
        view: o, unit, `(N, 3)`.
        light: environment map in its own frame.
        spacing: angle in radians between the mirror directions of neighbouring samples, `(N,)`.
    """
    mirrored = shading.reflect(normal, view)
    # The finest of the maps whose texels are as wide as the spacing.
    level = np.zeros(len(mirrored), np.int8)
    for finer in light.filtered[:-1]:
        level += spacing > math.pi / (len(finer) - 1e-6)
    out = np.empty(len(mirrored), mirrored.dtype)
    for number in np.flatnonzero(np.bincount(level)):
        some = np.flatnonzero(level == number)
        out[some] = environment.lookup(light.filtered[number], mirrored[some])
    return out


def specular(normal: np.ndarray, view: np.ndarray, exponent: float, light: Light) -> np.ndarray:
    """Compute S(n, o, s), `(N,)`.

    Args:
        normal: n, unit, `(N, 3)`, in the precision of the light.
        view: o, unit, `(N, 3)`, in the precision of the light.
        exponent: s.
        light: environment map in its own frame.
    """
    support = support_angle(exponent, light.quality.negligible)
    mirrored = shading.reflect(normal, view)
    order, groups = _groups(mirrored, max(_LEAST_CELLS, round(math.pi / support)))
    mirrored, normal = mirrored[order], normal[order]
    terms = shading.lobe_terms(normal, view[order])
    sums = np.empty(len(normal), normal.dtype)
    for rows, directions, energies in _cuts(mirrored, normal, groups, exponent, support, light):
        sums[rows] = shading.sum_lobes(terms[:, rows], exponent, directions, energies)
    out = np.empty_like(sums)
    out[order] = sums
    return out * np.asarray(shading.normaliser(float(exponent)), out.dtype)


def _cuts(
    mirrored: np.ndarray,
    normal: np.ndarray,
    groups: list[slice],
    exponent: float,
    support: float,
    light: Light,
) -> Iterator[Cut]:
    """Yield each group's samples with the lights that shine on one of them and in its lobe."""
    if not groups:
        return
    axes, radii = _cones(mirrored, groups)
    normals, spreads = _cones(normal, groups)
    least = np.cos(np.minimum(math.pi / 2 + spreads, math.pi))
    for first in range(0, len(groups), _TOGETHER):
        some = slice(first, first + _TOGETHER)
        cuts = light.cut(exponent, support, axes[some], radii[some])
        for rows, axis, lowest, (directions, energies) in zip(
            groups[some], normals[some], least[some], cuts, strict=True
        ):
            lit = directions @ axis >= lowest
            yield rows, directions[lit], energies[lit]


def _groups(directions: np.ndarray, cells: int) -> tuple[np.ndarray, list[slice]]:
    """Return the order `(N,)` of directions by the cells of a grid, and each cell's part of it."""
    place = np.floor((directions + 1) * (cells / 2)).astype(np.int64)
    cell = (place[:, 0] * (cells + 1) + place[:, 1]) * (cells + 1) + place[:, 2]
    order = np.argsort(cell, kind="stable")
    edges = np.flatnonzero(np.diff(cell[order], prepend=-1, append=-1))
    return order, [slice(*pair) for pair in itertools.pairwise(edges.tolist())]


def _cones(directions: np.ndarray, groups: list[slice]) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean direction of each group, `(G, 3)`, and the largest angle from it, `(G,)`.

    The groups are consecutive parts of the directions `(N, 3)`, all of them together.
    """
    starts = [rows.start for rows in groups]
    axes = np.add.reduceat(directions, starts)
    axes /= np.sqrt(np.einsum("ij,ij->i", axes, axes))[:, None]
    spread = np.repeat(axes, np.diff([*starts, len(directions)]), axis=0)
    cosine = np.minimum.reduceat(np.einsum("ij,ij->i", directions, spread), starts)
    return axes, np.arccos(np.clip(cosine, -1, 1))


def support_angle(exponent: float, negligible: float) -> float:
    """Return the angle from the mirror direction beyond which the lobe is negligible, at most π.

    At the angle θ between h and n, cos(θ)^s falls to `negligible`; the angle between i and the
    mirror direction is then at most 2θ, in radians.
    """
    if exponent <= 0:
        return math.pi
    return min(2 * math.acos(negligible ** (1.0 / exponent)), math.pi)
