"""Surfaces of revolution: random profiles, revolved about Y."""

from itertools import pairwise

import numpy as np

from . import parts, sweeps
from .meshes import Mesh, normalised

CORNER = np.radians(33)  # a profile that bends by more has separate normals on either side
SIDES = 88


def sample(rng: np.random.Generator, sides: int = SIDES) -> Mesh:
    """Draw a turned piece of that many sides: upright, closed, at times fluted or hollow."""
    return turned(_profile(rng), rng, sides)


def _profile(rng: np.random.Generator) -> np.ndarray:
    """Draw a polyline `(K, 2)` of radius and height, from the axis at the bottom back to it."""
    kind = rng.choice(3)
    if kind == 0:
        wall = _spline_profile(rng)
        return np.concatenate([[[0, wall[0, 1]]], wall, _cap(rng, *wall[-1])])
    if kind == 1:
        wall = _moulded_profile(rng)
        return np.concatenate([[[0, 0]], wall, _cap(rng, *wall[-1])])
    return _hollow(_spline_profile(rng), rng.uniform(0.03, 0.09))


def _spline_profile(rng: np.random.Generator) -> np.ndarray:
    """Draw random radii joined by Catmull-Rom splines: bottles, vases, bowls."""
    count = rng.integers(3, 7)
    radii = rng.uniform(0.15, 1.0, count + 2)
    t = np.linspace(0, count - 1, 80)
    spline = sweeps.spline(radii[:, None], t)[:, 0]
    height = np.exp(rng.uniform(np.log(0.6), np.log(4.0)))
    return np.stack([np.maximum(spline, 0.12), height * t / t[-1]], axis=1)


def _moulded_profile(rng: np.random.Generator) -> np.ndarray:
    """Draw a stack of mouldings with sharp edges: chessmen, balusters, spinning tops."""
    radius, y, pieces = rng.uniform(0.5, 1.0), 0.0, []
    for _ in range(rng.integers(3, 8)):
        target, height = rng.uniform(0.18, 1.0), rng.uniform(0.1, 0.7)
        f = np.linspace(0, 1, 20)
        ease = [f, 1 - np.sqrt(1 - f**2), np.sqrt(1 - (1 - f) ** 2), f * f * (3 - 2 * f)]
        bulge = rng.choice([0.0, 0.5, -0.3], p=(0.65, 0.25, 0.1)) * height * np.sin(np.pi * f)
        radii = radius + (target - radius) * ease[rng.integers(4)] + bulge
        pieces.append(np.stack([np.maximum(radii, 0.1), y + height * f], axis=1))
        radius = target if rng.random() < 0.7 else rng.uniform(0.2, 1.0)
        y += height
    return np.concatenate(pieces)


def _cap(rng: np.random.Generator, radius: float, y: float) -> np.ndarray:
    """Draw the profile of a top that closes the surface: flat, domed, pointed, or a knob."""
    kind = rng.choice(4)
    if kind == 0:
        return np.array([[0.0, y]])
    a = np.linspace(0, np.pi / 2, 24)[1:]
    if kind == 1:
        return np.stack([radius * np.cos(a), y + radius * rng.uniform(0.2, 1.2) * np.sin(a)], 1)
    if kind == 2:
        f = np.linspace(0, 1, 20)[1:]
        return np.stack([radius * (1 - f), y + radius * rng.uniform(0.4, 1.5) * f], 1)
    knob = radius * rng.uniform(0.5, 1.1)
    a = np.linspace(-np.pi / 3, np.pi / 2, 30)
    return np.stack([knob * np.cos(a), y + knob * (np.sin(a) + np.sin(np.pi / 3))], 1)


def _hollow(wall: np.ndarray, thickness: float) -> np.ndarray:
    """Make the profile of a vessel: up the outside, over a round lip, down inside to the floor."""
    a = np.linspace(0, np.pi, 9)[1:-1]
    rim = wall[-1] - (thickness / 2, 0)
    lip = rim + thickness / 2 * np.stack([np.cos(a), np.sin(a)], 1)
    inside = wall[::-1] - (thickness, 0)
    inside = inside[inside[:, 1] > thickness]
    return np.concatenate([[[0, 0]], wall, lip, inside, [[0, inside[-1, 1]]]])


def turned(profile: np.ndarray, rng: np.random.Generator, sides: int = SIDES) -> Mesh:
    """Revolve a profile about Y, at times with flutes, with creases at its sharp corners."""
    profile[[0, -1], 0] = 0
    profile = profile[np.r_[True, np.linalg.norm(np.diff(profile, axis=0), axis=1) > 1e-4]]
    profile[-1, 0] = 0
    flutes = int(rng.integers(3, 25))
    depth = rng.choice([0.0, rng.uniform(0.1, 0.6) / flutes], p=(0.6, 0.4))
    twist = rng.choice([0.0, rng.uniform(-1.0, 1.0)])
    angle = 2 * np.pi * np.arange(sides) / sides
    pieces = []
    for section in _sections(profile):
        points, outward = _revolved(section, angle, flutes, depth, twist)
        faces = _strip_faces(section[:, 0], len(angle))
        pieces.append((points.reshape(-1, 3), faces, outward.reshape(-1, 3)))
    return normalised(*parts.joined(pieces))


def _sections(profile: np.ndarray) -> list[np.ndarray]:
    """Cut a polyline at its corners; a section that is one straight line is divided by points."""
    tangents = np.diff(profile, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    cosine = (tangents[1:] * tangents[:-1]).sum(1)
    cuts = [0, *(np.flatnonzero(cosine < np.cos(CORNER)) + 1), len(profile) - 1]
    sections = [profile[a : b + 1] for a, b in pairwise(cuts)]
    share = np.linspace(0, 1, 9)[:, None]
    return [s[0] + share * (s[1] - s[0]) if len(s) == 2 else s for s in sections]


def _revolved(
    section: np.ndarray, angle: np.ndarray, flutes: int, depth: float, twist: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return points and outward normals, each `(rows, angles, 3)`, of a revolved section.

    A normal is the cross product of the tangents along the profile and around the axis.
    """
    radius, y = section[:, :1], np.broadcast_to(section[:, 1:], (len(section), len(angle)))
    phase = flutes * (angle + twist * y)
    ripple = 1 + depth * np.cos(phase)
    across = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], 1)
    along = np.stack([-np.sin(angle), 0 * angle, np.cos(angle)], 1)
    points = (radius * ripple)[..., None] * across
    points[..., 1] = y
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(section, axis=0), axis=1))]
    up = np.gradient(points, length, axis=0, edge_order=2 if len(section) > 2 else 1)
    # The tangent around is divided by the radius, so that it stays finite on the axis.
    around = ripple[..., None] * along - (flutes * depth * np.sin(phase))[..., None] * across
    return points, np.cross(up, around)


def _strip_faces(radii: np.ndarray, sides: int) -> np.ndarray:
    """Return the triangles between neighbouring rings; at the axis, one triangle for each side."""
    row, side = np.mgrid[: len(radii) - 1, :sides].reshape(2, -1)
    a, b = row * sides + side, row * sides + (side + 1) % sides
    lower = np.stack([a, a + sides, b], 1)[radii[row] > 0]
    upper = np.stack([b, a + sides, b + sides], 1)[radii[row + 1] > 0]
    return np.concatenate([lower, upper])
