"""Groups: several things in one scene, apart, touching, stacked or in a row."""

from collections.abc import Callable

import numpy as np

from . import parts
from .meshes import Mesh, normalised
from .parts import Part


def sample(rng: np.random.Generator, draw: Callable[[np.random.Generator], Mesh]) -> Mesh:
    """Draw two to four things, all different or copies of one, and place them.

    Args:
        rng: the only source of randomness.
        draw: draws one thing.
    """
    count = int(rng.choice([2, 3, 4], p=(0.6, 0.28, 0.12)))
    alike = rng.random() < 0.35
    first = draw(rng)
    things = [first if alike or k == 0 else draw(rng) for k in range(count)]
    pieces = [_turned(rng, thing) for thing in things]
    kind = rng.choice(3, p=(0.5, 0.25, 0.25))
    gap = rng.choice([0.0, rng.uniform(-0.15, 0.15)])
    placed = [pieces[0]]
    axis = parts.direction(rng)
    for piece in pieces[1:]:
        if kind == 0:  # about a random one of those that stand
            towards = parts.direction(rng)
            placed.append(_beside(placed[rng.integers(len(placed))], piece, towards, gap))
        elif kind == 1:  # one after the other
            placed.append(_beside(placed[-1], piece, axis, gap))
        else:  # on one floor
            angle = rng.uniform(0, 2 * np.pi)
            towards = np.array([np.cos(angle), 0, np.sin(angle)])
            moved = _beside(placed[-1], piece, towards, gap)
            shift = placed[0][0][:, 1].min() - moved[0][:, 1].min()
            placed.append((moved[0] + (0, shift, 0), moved[1], moved[2]))
    return normalised(*parts.joined(placed))


def _turned(rng: np.random.Generator, mesh: Mesh) -> Part:
    """Turn and scale a thing; half stay upright."""
    if rng.random() < 0.5:
        c, s = np.cos(angle := rng.uniform(0, 2 * np.pi)), np.sin(angle)
        rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    else:
        rotation = parts.turn(rng)
    size = rng.uniform(0.5, 1.0)
    return size * mesh.vertices @ rotation.T, mesh.faces, mesh.normals @ rotation.T


def _beside(still: Part, part: Part, towards: np.ndarray, gap: float) -> Part:
    """Move a part until it lies beside another in a direction, at a distance of `gap`."""
    middle = [(p[0].min(0) + p[0].max(0)) / 2 for p in (still, part)]
    vertices = part[0] + (middle[0] - middle[1])
    shift = (still[0] @ towards).max() + gap - (vertices @ towards).min()
    return vertices + shift * towards, part[1], part[2]
