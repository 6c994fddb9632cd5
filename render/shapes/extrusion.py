"""Extrusions of flat profiles: straight, tapered and twisted, with sharp or bevelled edges."""

import numpy as np
from manifold3d import CrossSection, Manifold
from scipy import ndimage

from . import parts, profiles, solids
from .fields import Field
from .meshes import Mesh, normalised

_TABLE = 128  # width of the table of distances to a profile


def sharp(rng: np.random.Generator) -> Mesh:
    """Draw an extrusion with sharp edges; half are tapered, and some twisted."""
    profile = profiles.draw(rng)
    height = parts.log_uniform(rng, 0.08, 3.0)
    twist = rng.choice([0.0, rng.uniform(-120, 120)], p=(0.7, 0.3))
    scale = rng.uniform(0.15, 1.2, 2)
    if rng.random() < 0.7:
        scale[1] = scale[0]
    if rng.random() < 0.5:
        scale[:] = 1.0
    divisions = int(abs(twist) // 5)
    solid = Manifold.extrude(profile, height, divisions, twist, tuple(scale))
    return normalised(*parts.of_solid(solid))


def bevelled(rng: np.random.Generator, cells: int) -> Mesh:
    """Draw an extrusion with rounded or chamfered edges.

    Args:
        rng: the only source of randomness.
        cells: number of cells of the grid for marching cubes.
    """
    profile = profiles.draw(rng)
    height = parts.log_uniform(rng, 0.12, 1.2)
    bevel = rng.uniform(0.2, 0.9) * min(height, 0.25)
    rounded, domed = rng.random() < 0.6, rng.choice([0.0, rng.uniform(0.1, 0.45) * height])
    flat = distance(profile)

    def field(p: np.ndarray) -> np.ndarray:
        d = flat(p[:2])
        z = np.abs(p[2]) + np.float32(domed) * (p[0] ** 2 + p[1] ** 2) - np.float32(height)
        if rounded:
            a, b = np.maximum(d + np.float32(bevel), 0), np.maximum(z + np.float32(bevel), 0)
            inner = np.minimum(np.maximum(d, z) + np.float32(bevel), 0)
            return inner + np.sqrt(a * a + b * b) - np.float32(bevel)
        return np.maximum(np.maximum(d, z), (d + z + np.float32(bevel)) / np.float32(np.sqrt(2)))

    return solids.polygonise(field, float(np.hypot(1.6, height)), cells)


def distance(profile: CrossSection) -> Field:
    """Return the signed distance to a profile, as a field of points `(2, N)`, by a table."""
    rings = profile.to_polygons()
    starts = np.concatenate(rings)
    ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    low, high = starts.min(0) - 0.3, starts.max(0) + 0.3
    step = (high - low) / (_TABLE - 1)
    x, y = (low[k] + step[k] * np.arange(_TABLE) for k in range(2))
    table = _signed_distance(x, y, starts, ends)

    def field(p: np.ndarray) -> np.ndarray:
        place = (p - low[:, None].astype(np.float32)) / step[:, None].astype(np.float32)
        return ndimage.map_coordinates(table, place, order=1, mode="nearest")

    return field


def _signed_distance(
    x: np.ndarray, y: np.ndarray, starts: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """Return the signed distance `(X, Y)`, negative inside, to closed polylines of edges."""
    px, py = x[:, None].astype(np.float32), y[None].astype(np.float32)
    nearest = np.full((len(x), len(y)), np.inf, np.float32)
    inside = np.zeros(nearest.shape, bool)
    for (ax, ay), (bx, by) in zip(starts.tolist(), ends.tolist(), strict=True):
        ex, ey = bx - ax, by - ay
        qx, qy = px - ax, py - ay
        t = np.clip((qx * ex + qy * ey) / max(ex * ex + ey * ey, 1e-12), 0, 1)
        nearest = np.minimum(nearest, (qx - t * ex) ** 2 + (qy - t * ey) ** 2)
        if ay != by:
            inside ^= ((ay <= py) != (by <= py)) & (px < ax + ex * (py - ay) / ey)
    return np.where(inside, -1, 1).astype(np.float32) * np.sqrt(nearest)
