"""Extreme lights, surfaces to be lit by them, and the factor c(s) of Eq. 3 as printed."""

import functools
import math

import numpy as np

from .precisions import Precision

HEIGHT = 32
"""Number of rows of an environment map."""
EXPONENTS = {"0": 0.0, "1e-6": 1e-6, "1": 1.0, "1e3": 1e3, "1e6": 1e6}


@functools.cache
def lights() -> dict[str, np.ndarray]:
    """Return environment maps `(32, 64)` of radiance by name."""
    shape = (HEIGHT, 2 * HEIGHT)
    uneven = np.random.default_rng(0).exponential(size=shape)

    def one_texel(row: int, column: int) -> np.ndarray:
        out = np.zeros(shape)
        out[row, column] = 100.0
        return out

    return {
        "black": np.zeros(shape),
        "furnace": np.ones(shape),
        "one texel in front": one_texel(13, 36),
        "one texel behind": one_texel(14, 3),
        "one texel at the pole": one_texel(0, 10),
        "one texel at the seam": one_texel(12, 63),
        "radiance 1e-8": 1e-8 * uneven,
        "radiance 1e8": 1e8 * uneven,
    }


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
            (
                math.sin(theta) * math.sin(phi),
                math.cos(theta),
                -math.sin(theta) * math.cos(phi),
            )
        )
        # The product of sines equals cos a − cos b of the row's edges, without cancellation.
        area = 2 * math.sin(theta) * math.sin(math.pi / (2 * height)) * (2 * math.pi / width)
        energies.append(area * radiance[row, column])
    return np.array(directions), np.array(energies)


def normaliser(s: float) -> float:
    """Return the factor c(s) as printed in Eq. 3."""
    return (s + 2) / (8 * math.pi * (1 - 2 ** (-(s + 2) / 2)))
