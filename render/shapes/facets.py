"""Faceted shapes: crystals, cut stones, low-poly balls and turned pieces, all with flat faces."""

import numpy as np
from manifold3d import CrossSection, Manifold

from . import parts
from .meshes import Mesh, normalised

_FLAT = 0.5  # degrees: every edge between two planes is a crease


def sample(rng: np.random.Generator) -> Mesh:
    """Draw a hull of points, a dented low-poly ball, a crystal cluster or a turned prism."""
    kind = rng.choice(4, p=(0.3, 0.25, 0.2, 0.25))
    solid = (_stone, _ball, _crystals, _turned)[kind](rng)
    return normalised(*parts.of_solid(solid, _FLAT))


def _stone(rng: np.random.Generator) -> Manifold:
    points = rng.normal(size=(int(rng.integers(6, 60)), 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True) ** rng.uniform(0.3, 1.0)
    return Manifold.hull_points(points * rng.uniform(0.3, 1.0, 3))


def _ball(rng: np.random.Generator) -> Manifold:
    """Draw a ball of few faces, its vertices moved along long waves and at random."""
    waves = rng.normal(size=(4, 3)) * rng.uniform(1, 4)
    phases = rng.uniform(0, 2 * np.pi, 4)
    depth, noise = rng.uniform(0.05, 0.35), rng.uniform(0, 0.08)
    stretch = rng.uniform(0.4, 1.0, 3)

    def moved(p: np.ndarray) -> np.ndarray:
        factor = 1 + depth * np.sin(p @ waves.T + phases).mean(1, keepdims=True) * 2
        return p * factor * stretch + noise * rng.normal(size=p.shape)

    return Manifold.sphere(1.0, int(rng.choice([8, 12, 16, 20]))).warp_batch(moved)


def _crystals(rng: np.random.Generator) -> Manifold:
    """Draw prisms with pointed ends that grow out of one place."""
    pieces = []
    for _ in range(rng.integers(1, 8)):
        sides, radius = int(rng.integers(4, 8)), rng.uniform(0.1, 0.35)
        height, tip = rng.uniform(0.4, 1.2), rng.uniform(0.2, 0.7)
        prism = Manifold.cylinder(height, radius * rng.uniform(0.6, 1), radius, sides)
        point = Manifold.cylinder(tip, radius, 0.0, sides).translate((0, 0, height))
        both = Manifold.batch_hull([prism, point])
        pieces.append(parts.placed(both, parts.turn(rng), np.zeros(3)))
    return parts.union(pieces)


def _turned(rng: np.random.Generator) -> Manifold:
    """Revolve a polyline of few points in few steps."""
    count = int(rng.integers(3, 8))
    heights = np.sort(rng.uniform(0, 2, count))
    heights = heights + 0.15 * np.arange(count)
    outline = np.stack([rng.uniform(0.15, 1.0, count), heights], 1)
    outline = np.concatenate([[[0, heights[0]]], outline, [[0, heights[-1]]]])
    return CrossSection([outline]).revolve(int(rng.integers(4, 13)))
