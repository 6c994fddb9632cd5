"""D, S and M at all samples of an image: fast, and tested against plain sums over every texel.

Directions are in the map's frame. For S, samples are grouped by mirror direction. A group shares
the lights of a `Light.cut`, without those behind the surface.
"""

import itertools
import math

import numpy as np

from lime_keras.optics import environment, shading

from .lights import Light

_LEAST_CELLS = 4
"""Fewest cells across the sphere into which mirror directions are sorted."""
_TOGETHER = 16
"""Number of groups whose lights are cut at once: few enough for the processor's cache."""


def diffuse(normal: np.ndarray, light: Light) -> np.ndarray:
    """Look up D(n), `(N,)`, for normals `(N, 3)` in the light's table."""
    return environment.lookup(light.diffuse_shading, normal)


def mirror(normal: np.ndarray, view: np.ndarray, light: Light) -> np.ndarray:
    """Compute M(n, o), `(N,)`, from the map at its finest resolution."""
    return shading.mirror(normal, view, light.radiance)


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
    for first in range(0, len(groups), _TOGETHER):
        some = groups[first : first + _TOGETHER]
        axes, radii = zip(*(_cone(mirrored[rows]) for rows in some), strict=True)
        cuts = light.cut(exponent, support, np.array(axes), np.array(radii, normal.dtype))
        for rows, (directions, energies) in zip(some, cuts, strict=True):
            axis, radius = _cone(normal[rows])
            lit = directions @ axis >= math.cos(min(math.pi / 2 + radius, math.pi))
            sums[rows] = shading.sum_lobes(terms[:, rows], exponent, directions[lit], energies[lit])
    out = np.empty_like(sums)
    out[order] = sums
    return out * np.asarray(shading.normaliser(float(exponent)), out.dtype)


def _groups(directions: np.ndarray, cells: int) -> tuple[np.ndarray, list[slice]]:
    """Sort directions `(N, 3)` by the cells of a grid around the sphere.

    Returns:
        The indices of the directions in their new order, `(N,)`; the part of each cell in it.
    """
    place = np.floor((directions + 1) * (cells / 2)).astype(np.int64)
    cell = (place[:, 0] * (cells + 1) + place[:, 1]) * (cells + 1) + place[:, 2]
    order = np.argsort(cell, kind="stable")
    edges = np.flatnonzero(np.diff(cell[order], prepend=-1, append=-1))
    return order, [slice(*pair) for pair in itertools.pairwise(edges.tolist())]


def _cone(group: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the mean direction of a group, and the largest angle of a member from it."""
    axis = np.add.reduce(group) / group.dtype.type(len(group))  # `mean` takes twice the time
    axis /= math.sqrt(axis.dot(axis))
    return axis, math.acos(min(max(float(np.minimum.reduce(group @ axis)), -1), 1))


def support_angle(exponent: float, negligible: float) -> float:
    """Return the angle from the mirror direction beyond which the lobe is negligible, at most π.

    At the angle θ between h and n, cos(θ)^s falls to `negligible`; the angle between i and the
    mirror direction is then at most 2θ, in radians.
    """
    if exponent <= 0:
        return math.pi
    return min(2 * math.acos(negligible ** (1.0 / exponent)), math.pi)
