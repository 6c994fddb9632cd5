"""Solids with sharp edges: joined, intersected, and carved by holes, slots, dents and chamfers."""

import numpy as np
from manifold3d import Manifold

from . import parts, profiles
from .meshes import Mesh, normalised

_LEAST_LEFT = 0.15  # share of a solid's volume that a change must leave; else it is not made


def sample(rng: np.random.Generator) -> Mesh:
    """Draw a solid of one to three pieces, and carve it one to five times."""
    solid = _piece(rng)
    for _ in range(rng.choice(3, p=(0.5, 0.3, 0.2))):
        solid += _placed_on(rng, solid, _piece(rng), rng.uniform(0.3, 0.8))
    changes = [_carved] * rng.choice([0, 1, 2, 3, 4], p=(0.1, 0.3, 0.3, 0.2, 0.1))
    if rng.random() < 0.25:
        changes.insert(0, _intersected)
    for change in changes:
        changed = change(rng, solid)
        solid = changed if changed.volume() > _LEAST_LEFT * solid.volume() else solid
    largest = max(solid.decompose(), key=lambda piece: piece.volume())
    return normalised(*parts.of_solid(largest))


def _piece(rng: np.random.Generator) -> Manifold:
    """Draw a plain solid around the origin, of half extents up to one."""
    kind = rng.choice(8, p=(0.22, 0.18, 0.1, 0.1, 0.12, 0.1, 0.08, 0.1))
    sides = int(rng.choice([3, 5, 6, 8, 32, 48]))
    if kind == 0:
        solid = Manifold.cube((2.0, 2.0, 2.0), True)
    elif kind == 1:
        solid = Manifold.cylinder(2.0, 1.0, 1.0, sides, True)
    elif kind == 2:
        solid = Manifold.cylinder(2.0, 1.0, rng.uniform(0.0, 0.8), sides, True)
    elif kind == 3:
        solid = Manifold.sphere(1.0, int(rng.choice([8, 48, 48])))
    elif kind == 4:
        solid = Manifold.hull_points(rng.uniform(-1, 1, (int(rng.integers(6, 24)), 3)))
    elif kind == 5:
        height = rng.uniform(0.5, 2.0)
        solid = Manifold.extrude(profiles.draw(rng), height).translate((0, 0, -height / 2))
    elif kind == 6:
        tube = rng.uniform(0.15, 0.45)
        section = profiles.convex(rng).scale((tube, tube)).translate((1 - tube, 0))
        solid = section.revolve(48)
    else:  # a box with all edges chamfered
        a = 1 - rng.uniform(0.08, 0.4)
        sizes = 2 * (a + (1 - a) * np.eye(3))
        solid = Manifold.batch_hull([Manifold.cube(tuple(size), True) for size in sizes])
    solid = solid.scale(tuple(rng.uniform(0.35, 1.0, 3)))
    return parts.placed(solid, _rotation(rng), np.zeros(3))


def _rotation(rng: np.random.Generator) -> np.ndarray:
    """Draw a rotation; two of three only exchange the axes, as in made things."""
    if rng.random() < 0.67:
        return np.roll(np.eye(3), rng.integers(3), axis=0)
    return parts.turn(rng)


def _extent(solid: Manifold) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle and the half extents of a solid's bounding box."""
    box = np.array(solid.bounding_box()).reshape(2, 3)
    return box.mean(0), (box[1] - box[0]) / 2


def _placed_on(rng: np.random.Generator, solid: Manifold, piece: Manifold, size: float) -> Manifold:
    """Scale a piece by `size`, and move it to a random place on the side of a solid."""
    vertices = np.asarray(solid.to_mesh().vert_properties)[:, :3]
    a, b = vertices[rng.integers(len(vertices), size=2)]
    middle, _ = _extent(solid)
    place = middle + rng.uniform(0.6, 0.95) * ((a + b) / 2 - middle)
    if rng.random() < 0.5:  # on an axis of the solid, as made things are
        place = np.where(np.arange(3) == rng.integers(3), place, middle)
    return piece.scale((size,) * 3).translate(tuple(place))


def _intersected(rng: np.random.Generator, solid: Manifold) -> Manifold:
    middle, half = _extent(solid)
    kind = rng.choice(3)
    if kind == 0:
        other = Manifold.sphere(1.0, 64).scale(tuple(half * rng.uniform(1.05, 1.35)))
    elif kind == 1:
        other = Manifold.cylinder(4.0, 1.0, 1.0, 64, True).scale((half[0] * 1.1, half[1] * 1.1, 1))
    else:
        other = parts.placed(Manifold.cube((1.9, 1.9, 1.9), True), parts.turn(rng), np.zeros(3))
        other = other.scale(tuple(half))
    return solid ^ other.translate(tuple(middle))


def _carved(rng: np.random.Generator, solid: Manifold) -> Manifold:
    """Take something away: a hole, a slot, a dent, a corner, the inside, or a row of holes."""
    middle, half = _extent(solid)
    least = float(half.min())
    rotation = _rotation(rng)
    kind = rng.choice(6, p=(0.25, 0.15, 0.15, 0.15, 0.15, 0.15))
    if kind == 0:
        sides = int(rng.choice([4, 6, 40]))
        radius = rng.uniform(0.2, 0.6) * least
        cutter = Manifold.cylinder(6.0, radius, radius, sides, True)
        offset = half * rng.uniform(-0.4, 0.4, 3)
        return solid - parts.placed(cutter, rotation, middle + offset)
    if kind == 1:
        size = half * rng.uniform(0.3, 0.8, 3)
        place = middle + half * (rng.choice([-1, 0, 1], 3))
        return solid - Manifold.cube(tuple(2 * size), True).translate(tuple(place))
    if kind == 2:
        ball = Manifold.sphere(rng.uniform(0.3, 0.9) * least, 48)
        return solid - _placed_on(rng, solid, ball, 1.0)
    if kind == 3:
        normal = parts.direction(rng)
        reach = np.asarray(solid.to_mesh().vert_properties)[:, :3] @ normal
        low = reach.min() + rng.uniform(0.1, 0.4) * np.ptp(reach)
        return solid.trim_by_plane(tuple(normal), float(low))
    if kind == 4:  # hollow, open at one end
        wall = rng.uniform(0.06, 0.2) * least
        scale = 1 - wall / half
        shift = np.zeros(3)
        axis = rng.integers(3)
        shift[axis] = 2 * wall
        inside = solid.translate(tuple(-middle)).scale(tuple(scale))
        inside = inside + inside.translate(tuple(shift))
        return solid - inside.translate(tuple(middle))
    count, radius = int(rng.integers(3, 8)), rng.uniform(0.1, 0.25) * least
    cutter = Manifold.cylinder(6.0, radius, radius, 24, True)
    if rng.random() < 0.5:
        cutter = Manifold.cube((2 * radius, 0.8 * radius, 6.0), True)
    span = 0.8 * np.linspace(-1, 1, count) if rng.random() < 0.5 else None
    for k in range(count):
        angle = 2 * np.pi * k / count
        place = (0.6 * np.cos(angle), 0.6 * np.sin(angle), 0) if span is None else (span[k], 0, 0)
        solid -= parts.placed(cutter, rotation, middle + rotation @ place * half)
    return solid
