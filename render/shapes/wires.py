"""Wires: bent tubes, springs, knots, ribbons, chains, cages and branches."""

import numpy as np
import trimesh
from manifold3d import Manifold

from . import parts, sweeps
from .meshes import Mesh, normalised
from .parts import Part

_POINTS = 220


def tubes(rng: np.random.Generator) -> Mesh:
    """Draw one to three tubes of round or angular section along random curves."""
    count = int(rng.choice([1, 2, 3], p=(0.7, 0.2, 0.1)))
    return normalised(*parts.joined([_tube(rng, _POINTS // count) for _ in range(count)]))


def chains(rng: np.random.Generator) -> Mesh:
    """Draw links that hold one another, along a line or in a ring."""
    count, thickness = int(rng.integers(2, 9)), rng.uniform(0.08, 0.22)
    stretch = rng.uniform(0.0, 1.2)
    pitch = 2 * (1 + stretch / 2) - 2.1 * thickness
    angle = 2 * np.pi * np.arange(32) / 32
    oval = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    oval[:, 0] += stretch / 2 * np.sign(np.cos(angle))
    links = []
    for k in range(count):
        tilt = (k % 2) * np.pi / 2 + rng.uniform(-0.25, 0.25)
        c, s = np.cos(tilt), np.sin(tilt)
        link = oval @ np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
        links.append(sweeps.tube(link + k * pitch * np.eye(3)[0], thickness, True))
    return normalised(*parts.joined(links))


def cages(rng: np.random.Generator) -> Mesh:
    """Draw the edges of a polyhedron, or of a bent lattice, as bars."""
    points, edges = (_polyhedron if rng.random() < 0.5 else _lattice)(rng)
    points = points * rng.uniform(0.4, 1.0, 3)
    radius = parts.log_uniform(rng, 0.025, 0.08)
    sides = int(rng.choice([4, 6, 12], p=(0.25, 0.15, 0.6)))
    rod = Manifold.cylinder(1.0, radius, radius, sides)
    vertices, faces, normals = parts.of_solid(rod)
    pieces = []
    for a, b in edges:
        length = float(np.linalg.norm(points[b] - points[a]))
        turn = parts.frame_along((points[b] - points[a]) / length).T
        pieces.append((vertices * (1, 1, length) @ turn + points[a], faces, normals @ turn))
    if rng.random() < 0.6:
        knob = Manifold.sphere(radius * rng.uniform(1.0, 2.2), 12)
        vertices, faces, normals = parts.of_solid(knob)
        pieces += [(vertices + point, faces, normals) for point in points]
    return normalised(*parts.joined(pieces))


def branches(rng: np.random.Generator) -> Mesh:
    """Draw branches that fork, each thinner than the one it grows from."""
    twigs, pieces = [(np.zeros(3), np.array([0.0, 1.0, 0.0]), 1.0, 0.12)], []
    spread, forks = rng.uniform(0.3, 0.9), int(rng.integers(2, 4))
    for _ in range(rng.integers(2, 4)):
        grown = []
        for start, along, length, radius in twigs:
            bent = along + 0.4 * parts.direction(rng)
            end = start + length * bent / np.linalg.norm(bent)
            middle = start + 0.5 * length * along
            curve = sweeps.smooth(np.stack([start, middle, end]), 12)
            thin = radius * rng.uniform(0.6, 0.9)
            pieces.append(sweeps.tube(curve, np.linspace(radius, thin, 12), False, 8))
            for _ in range(forks):
                aside = along + spread * 1.6 * parts.direction(rng)
                aside /= np.linalg.norm(aside)
                grown.append((end, aside, length * rng.uniform(0.6, 0.85), thin * 0.85))
        twigs = grown
    if rng.random() < 0.4:
        for start, *_ in twigs[:: int(forks)]:
            fruit = Manifold.sphere(rng.uniform(0.08, 0.3), 24).translate(tuple(start))
            pieces.append(parts.of_solid(fruit))
    return normalised(*parts.joined(pieces))


def _tube(rng: np.random.Generator, count: int) -> Part:
    curve, closed = _curve(rng, count)
    curve = sweeps.even(curve, count, closed)
    size = np.ptp(curve, axis=0).max()
    widest = min(0.7 * sweeps.tightest(curve, closed), 0.2 * size)
    radius = min(parts.log_uniform(rng, 0.022 * size, 0.12 * size), max(widest, 0.012 * size))
    kind = rng.choice(3, p=(0.6, 0.25, 0.15))
    along = np.linspace(0, 1, len(curve), endpoint=not closed)
    if kind == 0:
        waves = int(rng.integers(1, 9))
        depth = rng.choice([0.0, rng.uniform(0.1, 0.45)], p=(0.6, 0.4))
        radii = radius * (1 + depth * np.sin(2 * np.pi * waves * along)) / (1 + depth)
        if not closed and rng.random() < 0.35:
            radii = radii * np.linspace(1, rng.uniform(0.1, 0.7), len(radii))
        return sweeps.tube(curve, radii, closed, 14)
    if kind == 1:
        sides = int(rng.integers(3, 7))
        turns = _turns(rng, closed) if rng.random() < 0.5 else 0.0
        section = sweeps.angular(sweeps.circle(sides)[:-1])
        return sweeps.swept(curve, np.full(len(curve), radius), section, closed, turns)
    flat = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (1.0, rng.uniform(0.1, 0.35))
    radii = np.full(len(curve), min(1.5 * radius, max(widest, 0.012 * size)))
    return sweeps.swept(curve, radii, sweeps.angular(flat), closed, _turns(rng, closed))


def _turns(rng: np.random.Generator, closed: bool) -> float:
    return float(rng.integers(-2, 3)) if closed else rng.uniform(-2, 2)


def _curve(rng: np.random.Generator, count: int) -> tuple[np.ndarray, bool]:
    """Draw a curve `(K, 3)`, and return whether it is closed."""
    kinds = (_loop, _line, _spring, _knot, _spiral, _bent)
    return kinds[rng.choice(6, p=(0.18, 0.22, 0.2, 0.14, 0.1, 0.16))](rng, count)


def _loop(rng: np.random.Generator, count: int) -> tuple[np.ndarray, bool]:
    """Draw a closed curve of three harmonics."""
    t = 2 * np.pi * np.arange(count) / count
    curve = np.zeros((count, 3))
    for order in (1, 2, 3):
        a, b = rng.normal(size=(2, 3)) / order**1.5
        curve += np.cos(order * t)[:, None] * a + np.sin(order * t)[:, None] * b
    return curve, True


def _line(rng: np.random.Generator, count: int) -> tuple[np.ndarray, bool]:
    """Draw an open curve, a random walk that keeps to its direction."""
    steps = [parts.direction(rng)]
    for _ in range(rng.integers(2, 8)):
        step = steps[-1] + rng.uniform(0.4, 1.2) * parts.direction(rng)
        steps.append(step / np.linalg.norm(step))
    return sweeps.smooth(np.cumsum(steps, axis=0), count), False


def _spring(rng: np.random.Generator, count: int) -> tuple[np.ndarray, bool]:
    """Draw a coil, cylindrical or conical, on a straight axis."""
    turns, pitch = rng.uniform(2, 9), rng.uniform(0.15, 0.8)
    t = np.linspace(0, 2 * np.pi * turns, count)
    radius = np.linspace(1, rng.choice([1.0, rng.uniform(0.2, 1.0)]), count)
    return np.stack([radius * np.cos(t), pitch * t / np.pi / 2, radius * np.sin(t)], 1), False


def _knot(rng: np.random.Generator, count: int) -> tuple[np.ndarray, bool]:
    """Draw a torus knot; p and q without a common divisor."""
    p, q = ((2, 3), (3, 2), (2, 5), (3, 4), (3, 5), (1, 4), (1, 6), (5, 2))[rng.integers(8)]
    t = 2 * np.pi * np.arange(count) / count
    tube = rng.uniform(0.25, 0.5)
    ring = 1 + tube * np.cos(q * t)
    return np.stack([ring * np.cos(p * t), tube * np.sin(q * t), ring * np.sin(p * t)], 1), True


def _spiral(rng: np.random.Generator, count: int) -> tuple[np.ndarray, bool]:
    """Draw a spiral, flat or rising."""
    t = np.linspace(0.15, 1, count)
    angle = 2 * np.pi * rng.uniform(1.5, 5) * t
    rise = rng.choice([0.0, rng.uniform(0.2, 1.5)])
    return np.stack([t * np.cos(angle), rise * t, t * np.sin(angle)], 1), False


def _bent(rng: np.random.Generator, count: int) -> tuple[np.ndarray, bool]:
    """Draw a wire bent at a few places, mostly at right angles, with rounded corners."""
    points, axis = [np.zeros(3)], 0
    for _ in range(rng.integers(3, 9)):
        axis = int((axis + rng.integers(1, 3)) % 3)
        step = rng.choice([-1, 1]) * rng.uniform(0.4, 1.2) * np.eye(3)[axis]
        if rng.random() < 0.25:
            step = step + 0.5 * rng.normal(size=3)
        points.append(points[-1] + step)
    corners = np.array(points)
    share = rng.uniform(0.15, 0.45)
    pieces = [corners[:1]]
    t = np.linspace(0, 1, 9)[:, None]
    for a, b, c in zip(corners, corners[1:], corners[2:], strict=False):
        start, end = b + share * (a - b), b + share * (c - b)
        pieces.append((1 - t) ** 2 * start + 2 * t * (1 - t) * b + t**2 * end)
    return np.concatenate([*pieces, corners[-1:]]), False


def _polyhedron(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw points on an ellipsoid and the edges of their hull, or a regular prism's."""
    if rng.random() < 0.4:
        sides = int(rng.integers(3, 9))
        k = np.arange(sides)
        angle, top = 2 * np.pi * k / sides, rng.uniform(0.2, 1.2)
        ring = np.stack([np.cos(angle), -np.ones(sides), np.sin(angle)], 1)
        points = np.concatenate([ring, ring * (top, -1, top)])
        after = (k + 1) % sides
        edges = [np.stack([k, after], 1), np.stack([k, after], 1) + sides]
        edges.append(np.stack([k, k + sides], 1))
        return points, np.concatenate(edges)
    points = rng.normal(size=(int(rng.integers(4, 16)), 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    hull = trimesh.convex.convex_hull(points)
    return hull.vertices, hull.edges_unique


def _lattice(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw a flat or three-dimensional grid of points, and the edges between neighbours."""
    counts = [int(rng.integers(2, 7)), int(rng.integers(2, 6)), int(rng.choice([1, 1, 2]))]
    index = np.arange(int(np.prod(counts))).reshape(counts)
    axes = [np.linspace(-1, 1, n) if n > 1 else np.zeros(1) for n in counts]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    curl = rng.choice([0.0, rng.uniform(-0.8, 0.8)])
    points[:, 2] += curl * points[:, 0] ** 2
    edges = [
        np.stack([np.take(index, range(n - 1), k), np.take(index, range(1, n), k)], -1).reshape(
            -1, 2
        )
        for k, n in enumerate(counts)
    ]
    return points, np.concatenate(edges)
