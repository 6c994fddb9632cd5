"""D, S and M at all samples of an image: fast, and tested against plain sums over every texel.

Directions are in the map's frame. S is a sum over the lights of `Light.cut`, without the lights
outside the lobe: samples are grouped by mirror direction, and a group shares the lights near it.
"""

import math

import numpy as np

from lime_keras.optics import environment, shading

from .lights import Light

_WIDE = math.radians(75)
"""Largest support angle in radians with which samples are grouped; for wider lobes, groups would
save nothing."""
_CELL_ROWS = 12
_SLICE = 2**14  # mirror directions that are sorted into cells at once


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
    if support > _WIDE:
        return shading.specular(normal, view, exponent, directions, energies)
    cells = environment.directions(_CELL_ROWS, 2 * _CELL_ROWS).reshape(-1, 3).astype(normal.dtype)
    mirrored = shading.reflect(normal, view)
    cell = np.empty(len(normal), int)
    for first in range(0, len(normal), _SLICE):
        some = slice(first, first + _SLICE)
        cell[some] = np.argmax(mirrored[some] @ cells.T, axis=1)
    out = np.empty(len(normal), normal.dtype)
    for index in np.unique(cell):
        rows = np.flatnonzero(cell == index)
        radius = math.acos(float(np.clip(np.min(mirrored[rows] @ cells[index]), -1, 1)))
        reach = min(support + radius, math.pi)
        near = directions @ cells[index] >= math.cos(reach)
        out[rows] = shading.specular(
            normal[rows], view[rows], exponent, directions[near], energies[near]
        )
    return out


def support_angle(exponent: float, negligible: float) -> float:
    """Return the angle from the mirror direction beyond which the lobe is negligible, at most π.

    At the angle θ between h and n, cos(θ)^s falls to `negligible`; the angle between i and the
    mirror direction is then at most 2θ, in radians.
    """
    if exponent <= 0:
        return math.pi
    return min(2 * math.acos(negligible ** (1.0 / exponent)), math.pi)
