"""D, S and M of all samples of an image: fast, and tested against plain sums over every texel.

Directions are in the map's frame. S is a sum over a `Light.cut`; lights outside the lobe are not
visited: pixels are grouped by mirror direction, and each group shares the lights near it.
"""

import math

import numpy as np

from lime_keras.optics import environment, shading

from .lights import Light

_WIDE = math.radians(75)
"""A lobe that reaches further sees too much of the sphere for groups to pay."""
_CELL_ROWS = 12
_SLICE = 2**14  # normals sorted into cells at once


def diffuse(normal: np.ndarray, light: Light) -> np.ndarray:
    """D(n), `(N,)`, for normals `(N, 3)`: looked up where it was tabulated for all directions."""
    return environment.lookup(light.diffuse_shading, normal)


def mirror(normal: np.ndarray, view: np.ndarray, light: Light) -> np.ndarray:
    """M(n, o), `(N,)`, from the map's finest resolution."""
    return shading.mirror(normal, view, light.radiance)


def specular(normal: np.ndarray, view: np.ndarray, exponent: float, light: Light) -> np.ndarray:
    """S(n, o, s), `(N,)`; n and o unit, `(N, 3)`, in the precision of the light."""
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
    """Angle about the mirror direction beyond which the lobe is negligible, at most π radians.

    h leaves n by the θ at which cos(θ)^s falls to `negligible`, and i leaves the mirror direction
    by at most 2θ.
    """
    if exponent <= 0:
        return math.pi
    return min(2 * math.acos(negligible ** (1.0 / exponent)), math.pi)
