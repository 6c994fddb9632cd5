"""D, S and M at all samples of an image: fast, and tested against plain sums over every texel.

Directions are in the map's frame. S is a sum over the lights of `Light.cut`, without the lights
outside the lobe and without those behind the surface: samples are grouped by mirror direction, and
a group shares the lights near it.
"""

import math

import numpy as np

from lime_keras.optics import environment, shading

from .lights import Light

_LEAST_CELLS = 4
"""Fewest cells across the sphere into which mirror directions are sorted."""


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
    directions, energies = light.cut(exponent)
    support = support_angle(exponent, light.quality.negligible)
    mirrored = shading.reflect(normal, view)
    out = np.empty(len(normal), normal.dtype)
    for rows in _groups(mirrored, max(_LEAST_CELLS, round(math.pi / support))):
        near = _near(directions, normal[rows], math.pi / 2)
        near &= _near(directions, mirrored[rows], support)
        out[rows] = shading.specular(
            normal[rows], view[rows], exponent, directions[near], energies[near]
        )
    return out


def _groups(directions: np.ndarray, cells: int) -> list[np.ndarray]:
    """Return the indices of the directions `(N, 3)` in each cell of a grid around the sphere."""
    place = np.floor((directions + 1) * (cells / 2)).astype(np.int64)
    cell = place @ np.array([(cells + 1) ** 2, cells + 1, 1])
    order = np.argsort(cell, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(cell[order])) + 1)
    return [group for group in groups if len(group)]


def _near(directions: np.ndarray, group: np.ndarray, reach: float) -> np.ndarray:
    """Return whether each direction may be within `reach` radians of a member of the group."""
    middle = group.mean(axis=0)
    middle /= np.linalg.norm(middle)
    radius = math.acos(np.clip(np.min(group @ middle), -1, 1))
    return directions @ middle >= math.cos(min(reach + radius, math.pi))


def support_angle(exponent: float, negligible: float) -> float:
    """Return the angle from the mirror direction beyond which the lobe is negligible, at most π.

    At the angle θ between h and n, cos(θ)^s falls to `negligible`; the angle between i and the
    mirror direction is then at most 2θ, in radians.
    """
    if exponent <= 0:
        return math.pi
    return min(2 * math.acos(negligible ** (1.0 / exponent)), math.pi)
