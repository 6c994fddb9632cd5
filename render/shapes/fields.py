"""Implicit fields of random solids: compositions of primitives, blends of blobs, thin frames.

The families follow the procedural shapes of Xu et al., "Deep image-based relighting from optimal
sparse samples" (2018), and Li et al., "Learning to reconstruct shape and spatially-varying
reflectance from a single image" (2018): displaced primitives joined at random. Two families are
added: metaballs, which have necks, and frames, which have legs, wings, handles and hoops. Such thin
parts are the first that an estimated mask misses.

Letters: `p` points (3, N); `d` (N,) approximate signed distance, negative inside.
"""

from collections.abc import Callable

import numpy as np

from .parts import direction

Field = Callable[[np.ndarray], np.ndarray]
Solid = tuple[Field, float]
"""The field of a solid, and the radius of a ball around the origin that holds the solid."""

_LEAST_LEFT = 0.015  # least share of the cube of half width one that a carved solid still fills


def composition(rng: np.random.Generator) -> Solid:
    """Draw primitives that grow out of one another, displaced by waves."""
    parts: list[Field] = []
    sizes: list[float] = []
    centres = [np.zeros(3)]
    for k in range(rng.choice([1, 2, 3, 4, 5], p=(0.15, 0.25, 0.25, 0.2, 0.15))):
        size = rng.uniform(0.35, 0.7) if k else 0.7
        if k:
            parent = rng.integers(k)
            reach = rng.uniform(0.5, 1.0) * sizes[parent]
            centres.append(centres[parent] + reach * direction(rng))
        sizes.append(size)
        parts.append(_primitive(rng, size, centres[k]))
    softness = rng.choice([0.0, rng.uniform(0.02, 0.3)], p=(0.35, 0.65))
    waves = _displacement(rng)

    def field(p: np.ndarray) -> np.ndarray:
        d = parts[0](p)
        for part in parts[1:]:
            d = _join(d, part(p), softness)
        return d - waves(p)

    radius = max(np.linalg.norm(c) + 1.8 * s for c, s in zip(centres, sizes, strict=True))
    return field, float(radius)


def blobs(rng: np.random.Generator) -> Solid:
    """Draw overlapping balls, blended and stretched, often mirrored left to right."""
    count = int(rng.integers(3, 10))
    radii = rng.uniform(0.12, 0.45, count).astype(np.float32)
    radii[0] = rng.uniform(0.3, 0.5)
    centres = np.zeros((count, 3), np.float32)
    for k in range(1, count):
        parent = rng.integers(max(0, k - 3), k)
        reach = rng.uniform(0.6, 0.95) * (radii[parent] + radii[k])
        centres[k] = centres[parent] + reach * direction(rng)
    mirrored = rng.random() < 0.4
    softness = np.float32(np.exp(rng.uniform(np.log(0.02), np.log(0.12))))
    balls = list(zip(centres, radii, strict=True))
    stretch = rng.uniform(0.6, 1.4, (3, 1)).astype(np.float32)
    waves = _displacement(rng)

    def field(p: np.ndarray) -> np.ndarray:
        q = p * stretch
        if mirrored:
            q[0] = np.abs(q[0])
        distances = (np.sqrt(((q - c[:, None]) ** 2).sum(0)) - r for c, r in balls)
        total = sum(np.exp(np.minimum(-d / softness, 80)) for d in distances)
        return -softness * np.log(total + np.float32(1e-37)) - waves(p)

    reach = np.max(np.linalg.norm(centres, axis=1) + radii)
    return field, float(reach / stretch.min()) + 0.5


def frame(rng: np.random.Generator) -> Solid:
    """Draw thin bars, blades and hoops that grow out of a body, often mirrored left to right."""
    mirrored = rng.random() < 0.5
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0].astype(np.float32)  # of the mirror plane
    body = rng.uniform(0.08, 0.35, 3)
    body[rng.integers(3)] = rng.uniform(0.3, 0.8)
    a = body.astype(np.float32)[:, None]
    rounding = float(a.min()) * rng.uniform(0.1, 0.9)
    parts, joints = [lambda p: _box(p, a, rounding)], [body * rng.uniform(-0.8, 0.8, 3)]
    for _ in range(rng.integers(2, 7)):
        start = joints[rng.integers(len(joints))].copy()
        along = direction(rng)
        if mirrored:  # limbs are made in the half with x > 0, which is mirrored
            start[0], along[0] = abs(start[0]), abs(along[0])
        part, end = _limb(rng, start, along)
        parts.append(part)
        joints.extend([end, (start + end) / 2, body * rng.uniform(-0.8, 0.8, 3)])
    softness = rng.choice([0.0, rng.uniform(0.02, 0.08)])

    def field(p: np.ndarray) -> np.ndarray:
        q = turn @ p
        if mirrored:
            q[0] = np.abs(q[0])
        d = parts[0](q)
        for part in parts[1:]:
            d = _join(d, part(q), softness)
        return d

    return field, max(float(np.linalg.norm(joint)) for joint in joints) + 1.5


def carved(rng: np.random.Generator) -> Solid:
    """Draw a primitive that others cut into, through or off, rounded at the edges; some hollow."""
    axis = np.linspace(-1, 1, 16, dtype=np.float32)
    grid = np.stack(np.meshgrid(axis, axis, axis)).reshape(3, -1)
    while True:
        field = _carved(rng)
        if (field(grid) < 0).mean() > _LEAST_LEFT:
            return field, 1.8


def _carved(rng: np.random.Generator) -> Field:
    body = _primitive(rng, 0.8, np.zeros(3))
    softness = float(np.exp(rng.uniform(np.log(0.04), np.log(0.2))))
    wall = rng.choice([0.0, rng.uniform(0.06, 0.11)], p=(0.7, 0.3))
    softness = max(softness, wall)  # thin edges of a shell would be ragged
    cutters = []
    for _ in range(rng.integers(1, 5)):
        size = rng.uniform(0.25, 0.65)
        cutters.append(_primitive(rng, size, rng.uniform(0.35, 0.8) * direction(rng)))
    kept = _primitive(rng, 1.1, np.zeros(3)) if rng.random() < 0.35 else None
    waves = _displacement(rng) if rng.random() < 0.3 else None

    def field(p: np.ndarray) -> np.ndarray:
        d = body(p)
        if wall:
            d = np.abs(_scaled(body, d, p)) - np.float32(wall)
        if kept is not None:
            d = -_join(-d, -kept(p), softness)
        for cutter in cutters:
            d = -_join(-d, cutter(p), softness)
        return d if waves is None else d - waves(p)

    return field


def _scaled(solid: Field, d: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return a field divided by its slope, so that a wall is equally thick all over."""
    h = np.float32(0.02)
    slopes = [solid(p + h * np.eye(3, dtype=np.float32)[:, k : k + 1]) - d for k in range(3)]
    return d / np.maximum(np.sqrt(sum(s * s for s in slopes)) / h, np.float32(0.3))


def dented(rng: np.random.Generator) -> Solid:
    """Draw a solid with dents, bumps, grooves or ribs."""
    base = _primitive(rng, 0.8, np.zeros(3))
    marks: list[tuple[Field, bool]] = []
    for _ in range(rng.integers(1, 9)):
        surface = _exit(base, direction(rng), 2.0)
        size = float(np.exp(rng.uniform(np.log(0.1), np.log(0.7))))
        sunk = rng.random() < 0.6
        depth = size * rng.uniform(0.15, 0.7)
        away = surface / np.linalg.norm(surface) * (size - depth)
        centre = (surface + away if sunk else surface - away).astype(np.float32)[:, None]
        marks.append((_ball(centre, size), sunk))
    softness = float(np.exp(rng.uniform(np.log(0.01), np.log(0.15))))
    grooves = _grooves(rng) if rng.random() < 0.4 else None

    def field(p: np.ndarray) -> np.ndarray:
        d = base(p)
        for ball, sunk in marks:
            d = -_join(-d, ball(p), softness) if sunk else _join(d, ball(p), softness)
        return d if grooves is None else d + grooves(p)

    return field, 2.0


def _ball(centre: np.ndarray, radius: float) -> Field:
    return lambda p: np.sqrt(((p - centre) ** 2).sum(0)) - np.float32(radius)


def _exit(solid: Field, along: np.ndarray, reach: float) -> np.ndarray:
    """Return the last point inside a solid on a ray from the origin; the middle, if none is."""
    points = np.linspace(0.05, reach, 80) * along[:, None]
    inside = np.flatnonzero(solid(points.astype(np.float32)) < 0)
    return points[:, inside[-1] if len(inside) else len(points) // 4]


def _grooves(rng: np.random.Generator) -> Field:
    """Draw parallel or ring-shaped grooves, or ribs; a tenth to a third as deep as far apart."""
    axis = direction(rng).astype(np.float32) if rng.random() < 0.5 else np.eye(3, dtype="f4")[1]
    rate = np.float32(np.exp(rng.uniform(np.log(5), np.log(25))))
    depth = np.float32(rng.choice([-1, 1]) * rng.uniform(0.3, 1.0) / rate)
    sharpness = int(rng.choice([1, 2, 8]))
    return lambda p: depth * np.abs(np.cos(rate * (axis @ p))) ** sharpness


def _limb(
    rng: np.random.Generator, start: np.ndarray, along: np.ndarray
) -> tuple[Field, np.ndarray]:
    """Draw a bar, blade or hoop that begins at `start`; return its field and a point of its end."""
    kind = rng.choice(3, p=(0.5, 0.3, 0.2))
    thickness = float(np.exp(rng.uniform(np.log(0.045), np.log(0.13))))
    if kind == 0:
        end = start + rng.uniform(0.4, 1.3) * along
        taper = rng.uniform(0.6, 1.6)
        return lambda p: _bar(p, start, end, thickness, thickness * taper), end
    across = np.cross(along, direction(rng))
    across /= np.linalg.norm(across) + 1e-9
    axes = np.stack([along, np.cross(across, along), across]).astype(np.float32)
    if kind == 1:
        length, width = rng.uniform(0.25, 0.6), rng.uniform(0.12, 0.4)
        centre = (start + length * along).astype(np.float32)[:, None]
        a = np.array([[length], [0.8 * thickness], [width]], np.float32)
        rounding = 0.8 * thickness * rng.uniform(0.2, 1.0)
        return lambda p: _box(axes @ (p - centre), a, rounding), start + 1.8 * length * along
    ring = rng.uniform(0.25, 0.6)
    centre = (start + ring * along).astype(np.float32)[:, None]
    return lambda p: _torus(axes @ (p - centre), ring, thickness), start + 2 * ring * along


def _primitive(rng: np.random.Generator, size: float, centre: np.ndarray) -> Field:
    """Draw a superquadric, rounded box or torus of half extents up to `size`, turned at random."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0].astype(np.float32)
    a = (size * rng.uniform(0.35, 1.0, 3)).astype(np.float32)[:, None]
    centre = centre.astype(np.float32)[:, None]
    kind = rng.choice(3, p=(0.55, 0.3, 0.15))
    if kind == 0:
        e1, e2 = (float(e) for e in rng.choice([0.25, 0.6, 1.0, 1.0, 1.6], 2))
        return lambda p: _superquadric(turn @ (p - centre), a, e1, e2)
    if kind == 1:
        rounding = float(a.min()) * rng.uniform(0.05, 0.6)
        return lambda p: _box(turn @ (p - centre), a, rounding)
    ring, tube = 0.7 * size, size * rng.uniform(0.15, 0.3)
    return lambda p: _torus(turn @ (p - centre), ring, tube)


def _superquadric(p: np.ndarray, a: np.ndarray, e1: float, e2: float) -> np.ndarray:
    """Return |p| (1 - F^(-e1/2)), the radial distance, for the inside-outside function F."""
    x, y, z = np.abs(p / a) + np.float32(1e-6)
    level = (x ** (2 / e2) + y ** (2 / e2)) ** (e2 / e1) + z ** (2 / e1)
    return np.sqrt((p * p).sum(0)) * (1 - (level + np.float32(1e-30)) ** (-e1 / 2))


def _box(p: np.ndarray, a: np.ndarray, rounding: float) -> np.ndarray:
    q = np.abs(p) - (a - np.float32(rounding))
    outside = np.sqrt((np.maximum(q, 0) ** 2).sum(0))
    return outside + np.minimum(q.max(0), 0) - np.float32(rounding)


def _bar(
    p: np.ndarray, start: np.ndarray, end: np.ndarray, radius: float, end_radius: float
) -> np.ndarray:
    """Return the distance to a round bar whose radius goes from `radius` to `end_radius`."""
    axis = (end - start).astype(np.float32)
    q = p - start.astype(np.float32)[:, None]
    t = np.clip((axis @ q) / np.float32(axis @ axis), 0, 1)
    radii = np.float32(radius) + t * np.float32(end_radius - radius)
    return np.sqrt(((q - axis[:, None] * t) ** 2).sum(0)) - radii


def _torus(p: np.ndarray, ring: float, tube: float) -> np.ndarray:
    return np.hypot(np.hypot(p[0], p[2]) - np.float32(ring), p[1]) - np.float32(tube)


def _join(d: np.ndarray, other: np.ndarray, softness: float) -> np.ndarray:
    """Return the distance to the union of two solids, blended over `softness` by a quadratic."""
    if softness == 0:
        return np.minimum(d, other)
    overlap = np.maximum(np.float32(softness) - np.abs(d - other), 0)
    return np.minimum(d, other) - overlap * overlap / np.float32(4 * softness)


def _displacement(rng: np.random.Generator) -> Field:
    """Draw plane waves of one band, often none; a bounded slope keeps the solid in one piece."""
    if rng.random() < 0.4:
        return lambda p: np.zeros((), np.float32)
    frequency = np.exp(rng.uniform(np.log(4), np.log(22)))
    amplitude = np.float32(rng.uniform(0.1, 0.55) / frequency)
    waves = np.stack([direction(rng) for _ in range(5)]) * frequency
    waves = (waves * rng.uniform(0.7, 1.3, (5, 1))).astype(np.float32)
    phases = rng.uniform(0, 2 * np.pi, (5, 1)).astype(np.float32)
    return lambda p: amplitude * np.sin(waves @ p + phases).sum(0) / np.float32(np.sqrt(5))
