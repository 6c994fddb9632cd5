"""Random flat profiles: polygons, stars, gears, flowers, strokes as of letters, plates with holes.

All fit about the unit circle. They are what `extrusion` gives a height.
"""

import numpy as np
from manifold3d import CrossSection, JoinType


def draw(rng: np.random.Generator) -> CrossSection:
    """Draw a profile in one piece; a third have holes, a third have rounded corners."""
    kinds = [_polygon, _radial, _gear, _flower, _rectangle, _strokes, _ring, _lens]
    outline = kinds[rng.choice(len(kinds), p=(0.14, 0.14, 0.12, 0.13, 0.13, 0.18, 0.08, 0.08))](rng)
    if rng.random() < 0.35:
        pierced = _pierced(rng, outline)
        outline = pierced if pierced.area() > 0.4 * outline.area() else outline
    if rng.random() < 0.35:
        outline = _rounded(outline, rng.uniform(0.02, 0.12))
    return max(outline.decompose(), key=lambda piece: piece.area())


def convex(rng: np.random.Generator) -> CrossSection:
    """Draw a profile without holes: a disc, rectangle or polygon; half have rounded corners."""
    outline = (_polygon, _rectangle, _disc)[rng.choice(3, p=(0.3, 0.4, 0.3))](rng)
    return _rounded(outline, rng.uniform(0.03, 0.15)) if rng.random() < 0.5 else outline


def _rounded(outline: CrossSection, radius: float) -> CrossSection:
    """Round the corners that stick out; where nothing is left, the profile stays as it was."""
    round_ = outline.offset(-radius, JoinType.Miter).offset(radius, JoinType.Round, 2.0, 24)
    return outline if round_.area() < 0.6 * outline.area() else round_


def _angles(count: int) -> np.ndarray:
    return 2 * np.pi * np.arange(count) / count


def _at(radii: np.ndarray | float, angles: np.ndarray) -> np.ndarray:
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)


def _disc(rng: np.random.Generator) -> CrossSection:
    return CrossSection.circle(1.0, 48).scale((1.0, rng.choice([1.0, rng.uniform(0.4, 1.0)])))


def _polygon(rng: np.random.Generator) -> CrossSection:
    """Draw a polygon of 3 to 9 corners, regular or not."""
    angles = _angles(int(rng.integers(3, 10)))
    step = angles[1]
    uneven = rng.choice([0.0, rng.uniform(0.1, 0.35)])
    angles = angles + uneven * step * rng.uniform(-1, 1, len(angles))
    return CrossSection([_at(1 - uneven * rng.uniform(0, 1, len(angles)), angles)])


def _radial(rng: np.random.Generator) -> CrossSection:
    """Draw a star of 3 to 14 points."""
    points = int(rng.integers(3, 15))
    radii = np.where(np.arange(2 * points) % 2, rng.uniform(0.3, 0.85), 1.0)
    return CrossSection([_at(radii, _angles(2 * points))])


def _gear(rng: np.random.Generator) -> CrossSection:
    teeth = int(rng.integers(6, 25))
    root, share = rng.uniform(0.65, 0.9), rng.uniform(0.3, 0.6)
    slope = rng.uniform(0.0, 0.2)
    edges = np.array([0, slope, share, share + slope]) / 1.0
    angles = (np.arange(teeth)[:, None] + edges) * 2 * np.pi / teeth
    radii = np.broadcast_to([root, 1.0, 1.0, root], angles.shape)
    return CrossSection([_at(radii.ravel(), angles.ravel())])


def _flower(rng: np.random.Generator) -> CrossSection:
    """Draw a smooth closed curve: a sum of three waves around a circle."""
    angles = _angles(120)
    radii = np.ones(120)
    for _ in range(3):
        order = int(rng.integers(2, 9))
        radii += rng.uniform(0, 1.2 / order) * np.cos(order * angles + rng.uniform(0, 2 * np.pi))
    return CrossSection([_at(np.maximum(radii, 0.2) / radii.max(), angles)])


def _rectangle(rng: np.random.Generator) -> CrossSection:
    return CrossSection.square((2.0, rng.uniform(0.3, 2.0)), center=True)


def _strokes(rng: np.random.Generator) -> CrossSection:
    """Draw strokes between points of a grid, as of letters: L, T, U, H, X and others."""
    width = rng.uniform(0.12, 0.4)
    grid = np.stack(np.meshgrid([-0.7, 0, 0.7], [-1.0, 0, 1.0]), -1).reshape(-1, 2)
    place = int(rng.integers(9))
    outline = CrossSection()
    for _ in range(rng.integers(2, 6)):
        goal = int((place + rng.integers(1, 9)) % 9)
        along = grid[goal] - grid[place]
        stroke = CrossSection.square((float(np.linalg.norm(along)) + width, width), center=True)
        stroke = stroke.rotate(float(np.degrees(np.arctan2(along[1], along[0]))))
        outline += stroke.translate(tuple((grid[goal] + grid[place]) / 2))
        place = goal if rng.random() < 0.7 else place
    if rng.random() < 0.3:
        loop = CrossSection.circle(0.5, 48) - CrossSection.circle(0.5 - width, 48)
        outline += loop.translate(tuple(grid[place]))
    return outline


def _ring(rng: np.random.Generator) -> CrossSection:
    """Draw a ring, or a part of one."""
    inner = rng.uniform(0.4, 0.85)
    outline = CrossSection.circle(1.0, 72) - CrossSection.circle(inner, 72)
    if rng.random() < 0.6:
        opening = np.radians(rng.uniform(20, 140))
        wedge = [(0.0, 0.0), *_at(3.0, np.linspace(-opening, opening, 5))]
        outline -= CrossSection([np.array(wedge)])
    return outline


def _lens(rng: np.random.Generator) -> CrossSection:
    """Draw a crescent or a lens of two circles."""
    other = CrossSection.circle(rng.uniform(0.6, 1.2), 64).translate((rng.uniform(0.4, 0.9), 0.0))
    disc = CrossSection.circle(1.0, 64)
    return disc - other if rng.random() < 0.5 else disc ^ other


def _pierced(rng: np.random.Generator, outline: CrossSection) -> CrossSection:
    """Cut one hole, or a wheel of holes, out of a profile."""
    sides = int(rng.choice([3, 4, 6, 40]))
    if rng.random() < 0.5:
        hole = CrossSection.circle(rng.uniform(0.15, 0.6), sides)
        return outline - hole.translate(tuple(rng.uniform(-0.2, 0.2, 2)))
    count = int(rng.integers(3, 9))
    reach = rng.uniform(0.4, 0.65)
    hole = CrossSection.circle(rng.uniform(0.3, 0.8) * reach * np.sin(np.pi / count), sides)
    for angle in _angles(count):
        outline -= hole.translate((reach, 0.0)).rotate(float(np.degrees(angle)))
    return outline
