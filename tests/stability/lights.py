"""Extreme lights, surfaces to be lit by them, and the factor c(s) of Eq. 3 as printed."""

import functools
import math
from collections.abc import Mapping

import numpy as np

from .precisions import Precision

HEIGHT = 32  # number of rows of an environment map
EXPONENTS = {"0": 0.0, "1e-6": 1e-6, "1": 1.0, "1e3": 1e3, "1e6": 1e6}


@functools.cache
def lights() -> dict[str, np.ndarray]:
    """Return environment maps `(32, 64)` of radiance by name."""
    texels = {
        "in front": (13, 36),
        "behind": (14, 3),
        "at the pole": (0, 10),
        "at the seam": (12, 63),
    }
    return extreme(HEIGHT, 100.0, texels)


def extreme(
    height: int, bright: float, texels: Mapping[str, tuple[int, int]]
) -> dict[str, np.ndarray]:
    """Return maps `(height, 2 * height)` of radiance by name.

    Args:
        height: number of rows.
        bright: radiance of a map's only texel that is lit.
        texels: row and column of such a texel by the name of its place.
    """
    shape = (height, 2 * height)
    uneven = np.random.default_rng(0).exponential(size=shape)
    out = {"black": np.zeros(shape), "furnace": np.ones(shape)}
    for place, texel in texels.items():
        out[f"one texel {place}"] = np.zeros(shape)
        out[f"one texel {place}"][texel] = bright
    return out | {"radiance 1e-8": 1e-8 * uneven, "radiance 1e8": 1e8 * uneven}


@functools.cache
def surface() -> tuple[np.ndarray, np.ndarray]:
    """Return normals and view directions `(N, 3)`: random, grazing and along the axes."""
    rng = np.random.default_rng(1)
    normal = unit(rng.normal(size=(24, 3)))
    view = unit(normal + 0.9 * unit(rng.normal(size=(24, 3))))
    across = unit(np.cross(normal[:8], view[:8]))
    grazing = unit(across + 1e-4 * normal[:8])
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    n = np.concatenate([normal, normal[:8], axes, axes])
    o = np.concatenate([view, grazing, axes, np.roll(axes, 1, axis=0)])
    return n, o


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors `(N, 3)` scaled to length 1."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@functools.cache
def texels(light: str, precision: Precision) -> tuple[np.ndarray, np.ndarray]:
    """Return the texels of a map as lights, computed one by one.

    Returns:
        Directions `(T, 3)` to the texels, and energies `(T,)`: radiance times solid angle.
    """
    radiance = precision.rounded(lights()[light])
    height, width = radiance.shape
    directions, energies = [], []
    for row, column in np.ndindex(height, width):
        theta, phi = math.pi * (row + 0.5) / height, 2 * math.pi * (column + 0.5) / width
        directions.append(
            (math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi))
        )
        # The product of sines equals cos a − cos b of the row's edges, without cancellation.
        area = 2 * math.sin(theta) * math.sin(math.pi / (2 * height)) * (2 * math.pi / width)
        energies.append(area * radiance[row, column])
    return np.array(directions), np.array(energies)


def normaliser(s: float) -> float:
    """Return the factor c(s) as printed in Eq. 3."""
    return (s + 2) / (8 * math.pi * (1 - 2 ** (-(s + 2) / 2)))
