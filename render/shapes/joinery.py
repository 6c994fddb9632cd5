"""Things of several pieces: tables, chairs, racks, lamps, mugs, wheels, fans and tools.

Sizes are about one; z is up.
"""

import numpy as np
from manifold3d import CrossSection, Manifold

from . import parts, profiles, sweeps
from .meshes import Mesh, normalised
from .parts import Part, bar, union

_UPRIGHT = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # from z up to y up


def sample(rng: np.random.Generator) -> Mesh:
    """Draw a thing made of plates, bars, bowls and handles."""
    kinds = (_table, _chair, _rack, _lamp, _vessel, _wheel, _fan, _tool, _ladder)
    kind = kinds[rng.choice(9, p=(0.13, 0.12, 0.1, 0.1, 0.2, 0.1, 0.1, 0.1, 0.05))]
    vertices, faces, normals = parts.joined(kind(rng))
    return normalised(vertices @ _UPRIGHT, faces, normals @ _UPRIGHT)


def _sides(rng: np.random.Generator) -> int:
    return int(rng.choice([4, 6, 20], p=(0.35, 0.1, 0.55)))


def _legs(rng: np.random.Generator, half: np.ndarray, top: float, count: int) -> list[Manifold]:
    """Draw legs under a plate of half extents `half`, at times with bars between them."""
    splay, sides = rng.choice([0.0, rng.uniform(0.0, 0.35)]), _sides(rng)
    thick = parts.log_uniform(rng, 0.025, 0.11)
    thin = thick * rng.uniform(0.5, 1.1)
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    foot = np.stack([np.cos(angle), np.sin(angle)], 1)
    if count == 4:
        foot = np.sign(foot)
    head = foot * (half - 1.2 * thick)
    foot = head * (1 + splay)
    tops, feet = np.insert(head, 2, top, axis=1), np.insert(foot, 2, 0.0, axis=1)
    pieces = [bar(b, a, thin, thick, sides) for a, b in zip(tops, feet, strict=True)]
    if rng.random() < 0.45:
        f = rng.uniform(0.2, 0.6)
        joints = feet + f * (tops - feet)
        for k in range(count):
            pieces.append(bar(joints[k], joints[(k + 1) % count], 0.5 * thin, 0.5 * thin, sides))
    return pieces


def _table(rng: np.random.Generator) -> list[Part]:
    height, thick = rng.uniform(0.3, 2.2), rng.uniform(0.04, 0.25)
    half = np.array([1.0, rng.uniform(0.5, 1.0)])
    profile = profiles.convex(rng).scale(tuple(half))
    x0, y0, x1, y1 = profile.bounds()
    inner = 0.8 * np.array([x1 - x0, y1 - y0]) / 2
    if rng.random() < 0.2:  # one leg on a foot
        radius = rng.uniform(0.05, 0.15)
        column = bar(np.zeros(3), np.array([0, 0, height]), radius, radius * rng.uniform(0.6, 1.4))
        foot = Manifold.cylinder(rng.uniform(0.04, 0.2), rng.uniform(0.4, 0.8), 0.3, 40)
        pieces = [column, foot]
    else:
        pieces = _legs(rng, inner, height + 0.5 * thick, int(rng.choice([3, 4, 4, 4, 6])))
    plate = Manifold.extrude(profile, thick).translate((0, 0, height))
    return [parts.of_solid(union([plate, *pieces]))]


def _chair(rng: np.random.Generator) -> list[Part]:
    height, thick = rng.uniform(0.6, 1.2), rng.uniform(0.05, 0.2)
    half = np.array([0.6, rng.uniform(0.5, 0.7)])
    pieces = [Manifold.cube((*(2 * half), thick), True).translate((0, 0, height))]
    pieces += _legs(rng, half, height, 4)
    back, lean = rng.uniform(0.6, 1.3), rng.uniform(0.0, 0.3)
    radius, sides = parts.log_uniform(rng, 0.03, 0.08), _sides(rng)
    low, high = (
        np.array([-half[0] + radius, 0, height]),
        np.array([-half[0] - lean, 0, height + back]),
    )
    across = np.array([0, half[1] - radius, 0])
    pieces += [bar(low + s * across, high + s * across, radius, radius, sides) for s in (-1, 1)]
    count, upright = int(rng.integers(1, 6)), rng.random() < 0.5
    for f in (np.arange(count) + 1) / (count + 1):
        if upright:
            shift = (2 * f - 1) * across
            pieces.append(bar(low + shift, high + shift, 0.6 * radius, 0.6 * radius, sides))
        else:
            at = low + f * (high - low)
            pieces.append(bar(at - across, at + across, 0.7 * radius, 0.7 * radius, sides))
    pieces.append(bar(high - 1.1 * across, high + 1.1 * across, 1.1 * radius, 1.1 * radius, sides))
    if rng.random() < 0.4:  # arms
        for s in (-1, 1):
            rest = low + 0.45 * (high - low) + s * across
            front = rest + np.array([1.6 * half[0], 0, 0])
            pieces.append(bar(rest, front, radius, radius, sides))
            pieces.append(bar(front, front * (1, 1, 0) + (0, 0, height), radius, radius, sides))
    return [parts.of_solid(union(pieces))]


def _rack(rng: np.random.Generator) -> list[Part]:
    """Draw boards between posts."""
    half = rng.uniform(0.3, 1.0, 3)
    radius, sides = parts.log_uniform(rng, 0.02, 0.07), _sides(rng)
    pieces = []
    for x in (-1, 1):
        for y in (-1, 1):
            foot = np.array([x, y, -1]) * half
            pieces.append(bar(foot, foot * (1, 1, -1), radius, radius, sides))
    for z in np.linspace(rng.uniform(-0.9, -0.3), rng.uniform(0.5, 1.0), int(rng.integers(2, 6))):
        if rng.random() < 0.6:
            board = Manifold.cube((2 * half[0], 2 * half[1], 1.2 * radius), True)
            pieces.append(board.translate((0, 0, z * half[2])))
        else:
            for y in np.linspace(-1, 1, int(rng.integers(3, 8))):
                a = np.array([-1, y, z]) * half
                pieces.append(bar(a, a * (-1, 1, 1), 0.7 * radius, 0.7 * radius, sides))
            for x in (-1, 1):
                a = np.array([x, -1, z]) * half
                pieces.append(bar(a, a * (1, -1, 1), 0.7 * radius, 0.7 * radius, sides))
    return [parts.of_solid(union(pieces))]


def _cup(rng: np.random.Generator, low: float, high: float, height: float, wall: float) -> Manifold:
    """Return a cup of radii `low` at its floor and `high` at its rim; its wall may bulge."""
    t = np.linspace(0, 1, 16)
    bulge = rng.choice([0.0, rng.uniform(0.0, 0.3)]) * np.sin(np.pi * t)
    outer = np.stack([low + (high - low) * t + bulge, height * t], 1)
    inner = (outer - (wall, 0))[::-1]
    inner = inner[inner[:, 1] > wall]
    outline = np.concatenate([[[0, 0]], outer, inner, [[inner[-1, 0], wall], [0, wall]]])
    return CrossSection([outline]).revolve(56)


def _lamp(rng: np.random.Generator) -> list[Part]:
    foot, height = rng.uniform(0.25, 0.6), rng.uniform(0.8, 2.4)
    radius = rng.uniform(0.02, 0.07)
    base = Manifold.cylinder(rng.uniform(0.04, 0.15), foot, foot * rng.uniform(0.4, 1.0), 40)
    low, high = rng.uniform(0.3, 0.8), rng.uniform(0.1, 0.6)
    tall = rng.uniform(0.3, 0.8)
    shade = Manifold.cylinder(tall, low, high, 48)
    wall = 0.04
    shade -= Manifold.cylinder(1.2 * tall, low - wall, high - wall, 48).translate(
        (0, 0, -0.1 * tall)
    )
    reach = rng.choice([0.0, rng.uniform(0.3, 0.9)])
    knots = [(0, 0, 0), (0, 0, 0.6 * height), (0.3 * reach, 0, 0.95 * height), (reach, 0, height)]
    pole = sweeps.tube(sweeps.smooth(np.array(knots), 40, False), radius, False)
    bulb = Manifold.sphere(0.5 * min(low, high) + 0.05, 32).translate((reach, 0, height))
    shade = shade.translate((reach, 0, height - 0.3 * tall))
    return [parts.of_solid(solid) for solid in (base, shade, bulb)] + [pole]


def _vessel(rng: np.random.Generator) -> list[Part]:
    """Draw a mug, jug, pan, bucket or basket: a cup with a handle, an arch or a spout."""
    low, high = rng.uniform(0.35, 0.8), rng.uniform(0.45, 1.0)
    height, wall = rng.uniform(0.25, 1.8), rng.uniform(0.03, 0.1)
    thick = parts.log_uniform(rng, 0.03, 0.1)
    cup = parts.of_solid(_cup(rng, low, high, height, wall))
    kind = rng.choice(4, p=(0.45, 0.25, 0.2, 0.1))
    if kind == 0:
        return [cup, *_ears(rng, low, high, height, thick)]
    if kind == 1:  # a pan's handle
        length = rng.uniform(0.8, 2.0)
        knots = [(high - wall, 0.85), (high + 0.3, 1.0), (high + length, 1.1)]
        return [cup, sweeps.tube(_upright(knots, height, 30), thick, False)]
    if kind == 2:  # an arch over the rim, which may lean
        angle, lean = np.linspace(0, np.pi, 40), rng.uniform(-0.9, 0.9)
        rise = rng.uniform(0.5, 1.2) * np.sin(angle)
        arch = np.stack([high * np.cos(angle), np.sin(lean) * rise, 0.95 * height + rise], 1)
        return [cup, sweeps.tube(arch, 0.7 * thick, False)]
    knots = [(0.9 * low, 0.2), (1.3 * high, 0.4), (1.6 * high, 1.05)]
    spout = sweeps.tube(_upright(knots, height, 30), np.linspace(2 * thick, thick, 30), False)
    squash = rng.uniform(0.2, 0.6)
    lid = Manifold.sphere(high - 0.5 * wall, 48).scale((1, 1, squash))
    knob = Manifold.sphere(0.15, 24).translate((0, 0, squash * high + 0.08))
    return [cup, spout, *(parts.of_solid(s.translate((0, 0, height))) for s in (lid, knob))]


def _ears(
    rng: np.random.Generator, low: float, high: float, height: float, thick: float
) -> list[Part]:
    """Draw one handle of a mug, or two that face each other."""
    out = rng.uniform(0.3, 0.7)
    a, b = rng.uniform(0.1, 0.35), rng.uniform(0.65, 0.92)
    start, end = (low + (high - low) * f - 0.02 for f in (a, b))
    middle = (low + high) / 2 + out
    knots = [(start, a), (start + 0.8 * out, a), (middle, (a + b) / 2), (end + 0.8 * out, b)]
    ear = sweeps.tube(_upright([*knots, (end, b)], height, 40), thick, False)
    other = ear[0] * (-1, -1, 1), ear[1], ear[2] * (-1, -1, 1)
    return [ear, other] if rng.random() < 0.5 else [ear]


def _upright(knots: list[tuple[float, float]], height: float, count: int) -> np.ndarray:
    """Return a smooth curve in the plane of x and z; the knots' second numbers are of `height`."""
    return sweeps.smooth(np.array([(x, 0.0, height * z) for x, z in knots]), count, False)


def _wheel(rng: np.random.Generator) -> list[Part]:
    spokes, thick = int(rng.integers(3, 13)), rng.uniform(0.05, 0.2)
    width = thick * rng.uniform(0.6, 2.5)
    section = profiles.convex(rng).scale((thick / 2, width / 2)).translate((1 - thick / 2, 0))
    hub_radius = rng.uniform(0.1, 0.3)
    hub = Manifold.cylinder(rng.uniform(1.0, 2.0) * width + 0.05, hub_radius, hub_radius, 40, True)
    radius, sides, dish = parts.log_uniform(rng, 0.015, 0.06), _sides(rng), rng.uniform(0, 0.2)
    pieces = [section.revolve(72), hub]
    for angle in 2 * np.pi * np.arange(spokes) / spokes:
        c, s = np.cos(angle), np.sin(angle)
        end = (1 - thick / 2) * np.array([c, s, 0])
        centre = np.array([0, 0, dish * rng.choice([0, 1])])
        pieces.append(bar(centre, end, radius, radius, sides))
    return [parts.of_solid(union(pieces))]


def _fan(rng: np.random.Generator) -> list[Part]:
    blades = int(rng.integers(2, 9))
    blade = profiles.convex(rng).scale((rng.uniform(0.1, 0.3), rng.uniform(0.02, 0.05)))
    blade = Manifold.extrude(blade, 1.0, 10, rng.uniform(-70, 70), (rng.uniform(0.4, 1.8), 1.0))
    blade = blade.rotate((0, 0, rng.uniform(0, 180))).rotate((0, 90, 0))
    hub = rng.uniform(0.12, 0.25)
    pieces = [Manifold.cylinder(rng.uniform(0.2, 0.6), hub, hub * rng.uniform(0.3, 1), 40, True)]
    pieces += [blade.rotate((0, 0, 360 * k / blades)) for k in range(blades)]
    return [parts.of_solid(union(pieces))]


def _tool(rng: np.random.Generator) -> list[Part]:
    """Draw a handle with a head: hammers, spades, spoons, brushes, keys."""
    length, radius = rng.uniform(1.2, 2.6), rng.uniform(0.04, 0.12)
    t = np.linspace(0, 1, 40)
    shaft = np.stack([0 * t, rng.uniform(-0.15, 0.15) * np.sin(3 * t), length * t], 1)
    swell = radius * (1 + rng.uniform(0, 0.5) * np.sin(2 * np.pi * rng.uniform(0.5, 2) * t))
    head = Manifold.extrude(profiles.draw(rng), rng.uniform(0.05, 0.8))
    size = rng.uniform(0.25, 0.6)
    x, y, z = rng.uniform(0.5, 1.0, 3)
    head = head.scale((size * x, size * y, size * z))
    head = head.rotate(tuple(90.0 * rng.integers(0, 2, 3))) if rng.random() < 0.8 else head
    box = np.array(head.bounding_box()).reshape(2, 3).mean(0)
    head = head.translate(tuple(np.array([0, 0, length]) - box))
    return [sweeps.tube(shaft, swell, False), parts.of_solid(head)]


def _ladder(rng: np.random.Generator) -> list[Part]:
    """Draw rails with rungs, or a fence or comb."""
    width, radius, sides = rng.uniform(0.2, 0.7), parts.log_uniform(rng, 0.02, 0.07), _sides(rng)
    over = rng.choice([0.0, 0.2])
    spread = rng.uniform(0.7, 1.3)
    ends = [np.array([[s * width, 0, -1], [s * width * spread, 0, 1]]) for s in (-1, 1)]
    rails = ends if rng.random() < 0.8 else ends[:1]
    pieces = [bar(low, high, radius, radius, sides) for low, high in rails]
    for f in np.linspace(0.06, 0.94, int(rng.integers(4, 12))):
        a, b = (low + f * (high - low) for low, high in ends)
        a, b = a - over * (b - a), b + over * (b - a)
        pieces.append(bar(a, b, 0.7 * radius, 0.7 * radius, sides))
    return [parts.of_solid(union(pieces))]
