"""D, S and M at all samples of an image: fast, and tested against plain sums over every texel.

Directions are in the map's frame. For S, samples are grouped by mirror direction. A group shares
the lights of a `Light.cut`, without those behind the surface.
"""

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
    groups = _groups(mirrored, max(_LEAST_CELLS, round(math.pi / support)))
    out = np.empty(len(normal), normal.dtype)
    for first in range(0, len(groups), _TOGETHER):
        some = groups[first : first + _TOGETHER]
        axes, radii = zip(*(_cone(mirrored[rows]) for rows in some), strict=True)
        cuts = light.cut(exponent, support, np.array(axes), np.array(radii, normal.dtype))
        for rows, (directions, energies) in zip(some, cuts, strict=True):
            axis, radius = _cone(normal[rows])
            lit = directions @ axis >= math.cos(min(math.pi / 2 + radius, math.pi))
            out[rows] = shading.specular(
                normal[rows], view[rows], exponent, directions[lit], energies[lit]
            )
    return out


def _groups(directions: np.ndarray, cells: int) -> list[np.ndarray]:
    """Return the indices of the directions `(N, 3)` in each cell of a grid around the sphere."""
    place = np.floor((directions + 1) * (cells / 2)).astype(np.int64)
    cell = place @ np.array([(cells + 1) ** 2, cells + 1, 1])
    order = np.argsort(cell, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(cell[order])) + 1)
    return [group for group in groups if len(group)]


def _cone(group: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the mean direction of a group, and the largest angle of a member from it."""
    axis = group.mean(axis=0)
    axis /= np.linalg.norm(axis)
    return axis, math.acos(np.clip(np.min(group @ axis), -1, 1))


def support_angle(exponent: float, negligible: float) -> float:
    """Return the angle from the mirror direction beyond which the lobe is negligible, at most π.

    At the angle θ between h and n, cos(θ)^s falls to `negligible`; the angle between i and the
    mirror direction is then at most 2θ, in radians.
    """
    if exponent <= 0:
        return math.pi
    return min(2 * math.acos(negligible ** (1.0 / exponent)), math.pi)
