"""Thin curved sheets: shells, bowls, shades, leaves, ribbons and folded plates."""

import numpy as np

from . import parts
from .meshes import Mesh, normalised
from .parts import Part

_ROWS = 40


def sample(rng: np.random.Generator) -> Mesh:
    """Draw a sheet of a thickness of 1.5 to 8 % of its size."""
    u, v = np.meshgrid(np.linspace(-1, 1, _ROWS), np.linspace(-1, 1, _ROWS), indexing="ij")
    kind = rng.choice(5, p=(0.3, 0.2, 0.2, 0.15, 0.15))
    thickness = parts.log_uniform(rng, 0.03, 0.16)
    surface = (_shell, _wavy, _shade, _leaf, _ramp)[kind](rng, u, v)
    return normalised(*thickened(surface, thickness))


def thickened(surface: np.ndarray, thickness: float) -> Part:
    """Give a grid of points `(R, C, 3)` a thickness: two faces along it, and a flat rim.

    Raises:
        ValueError: If the surface has no normal at a point, as where a whole side shrinks to one.
    """
    normal = np.cross(np.gradient(surface, axis=0), np.gradient(surface, axis=1))
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    if length.min() <= 0:
        raise ValueError("The surface has no normal at a point of the grid.")
    normal = normal / length
    rows, columns = surface.shape[:2]
    row, column = np.mgrid[: rows - 1, : columns - 1].reshape(2, -1)
    a = row * columns + column
    grid = np.concatenate(
        [
            np.stack([a, a + columns, a + 1], 1),
            np.stack([a + 1, a + columns, a + columns + 1], 1),
        ]
    )
    flat = surface.reshape(-1, 3)
    out = normal.reshape(-1, 3)
    upper, lower = flat + thickness / 2 * out, flat - thickness / 2 * out
    index = np.arange(rows * columns).reshape(rows, columns)
    sides = [index[:, 0], index[-1], index[::-1, -1], index[0, ::-1]]
    pieces = [(upper, grid, out), (lower, grid[:, ::-1], -out)]
    for side in sides:
        along = np.gradient(flat[side], axis=0)
        outward = np.cross(along, out[side])
        k, n = np.arange(len(side) - 1), len(side)
        quads = np.concatenate(
            [np.stack([k, k + n, k + 1], 1), np.stack([k + 1, k + n, k + n + 1], 1)]
        )
        rim = np.concatenate([upper[side], lower[side]])
        pieces.append((rim, quads, np.concatenate([outward, outward])))
    return parts.joined(pieces)


def _disc(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Map the square onto the disc; 0.97 keeps the corners off the singular points."""
    u, v = 0.97 * u, 0.97 * v
    return u * np.sqrt(1 - v * v / 2), v * np.sqrt(1 - u * u / 2)


def _shell(rng: np.random.Generator, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Draw a bowl, a saddle or a curved plate, with a round or square outline."""
    if rng.random() < 0.6:
        u, v = _disc(u, v)
    v = v * rng.uniform(0.4, 1.0)
    a, b = rng.uniform(-1.0, 1.0, 2)
    return np.stack([u, v, a * u**2 + b * v**2 + rng.uniform(-0.4, 0.4) * u**3], -1)


def _wavy(rng: np.random.Generator, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Draw a corrugated or crumpled plate."""
    z = np.zeros_like(u)
    for _ in range(rng.integers(1, 4)):
        a, b = rng.normal(size=2) * rng.uniform(1.5, 5)
        z += rng.uniform(0.1, 0.6) / np.hypot(a, b) * np.sin(a * u + b * v + rng.uniform(0, 6.3))
    return np.stack([u, v * rng.uniform(0.3, 1.0), z], -1)


def _shade(rng: np.random.Generator, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Draw a part of a surface of revolution: half pipes, lamp shades, collars."""
    angle = u * np.pi * rng.uniform(0.3, 0.97)
    radius = 1 + rng.uniform(-0.7, 0.7) * v + rng.uniform(-0.25, 0.4) * (1 - v * v)
    radius = np.maximum(radius, 0.15)
    height = rng.uniform(0.3, 1.5) * v
    return np.stack([radius * np.cos(angle), height, -radius * np.sin(angle)], -1)


def _leaf(rng: np.random.Generator, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Draw a leaf: a pointed outline, folded along its vein, and curled."""
    width = rng.uniform(0.2, 0.6) * (np.cos(u * np.pi / 2) ** rng.uniform(0.5, 1.0) + 0.04)
    y = v * width
    z = rng.uniform(-0.8, 0.8) * u**2 + rng.uniform(-0.5, 1.0) * np.sqrt(y**2 + 0.003)
    return np.stack([u, y, z], -1)


def _ramp(rng: np.random.Generator, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Draw a winding ramp or a twisted strip."""
    angle = u * np.pi * rng.uniform(0.3, 1.6)
    inner = rng.uniform(-0.6, 0.5)
    radius = inner + (1 - inner) * (v + 1) / 2
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), u * rng.uniform(0.5, 1.6)], -1)
