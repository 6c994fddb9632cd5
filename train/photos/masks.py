"""The masks that the material's subnetworks learn on: as SegmentationNet finds them, and damaged.

A network that has seen true masks alone loses on estimated ones what it had gained
(docs/lab/physics.md).
"""

import numpy as np

from . import paint

_PREDICTED, _DAMAGED = 0.5, 0.25
"""Shares of the photos with the network's own mask, and with a damaged one; the others' are true.
"""
_BLUR = (1, 4)
"""Smallest and largest radius, in pixels of 128, of the blur that edges of damaged masks move in.
"""
_MOVED = 0.35
"""Standard deviation of the level that an edge is cut at, about one half, along the edge."""
_SHARPNESS = 8.0  # slope of a damaged mask's edge over the coverage of its blur
_BITTEN = 0.3
"""Share of the damaged masks that lack a piece, and share of those that let a piece in."""


def input_mask(true: np.ndarray, generator: np.random.Generator) -> np.ndarray | None:
    """Return the mask that a photo's object is cut out with, `(S, S, 1)` float32 in [0, 1].

    Args:
        true: coverage `(S, S, 1)` in [0, 1].
        generator: source of all random numbers.

    Returns:
        The true mask or a damaged one; None where it is to be the one that SegmentationNet finds.
    """
    chance = generator.random()
    if chance < _DAMAGED:
        return damaged(true, generator)
    return None if chance < _DAMAGED + _PREDICTED else true


def damaged(mask: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return a mask `(S, S, 1)` whose edges have moved, and which may lack a piece or hold another.

    Smooth random fields decide where.
    """
    size = len(mask)
    radius = max(1, round(generator.uniform(*_BLUR) * size / 128))
    soft = paint.blurred(mask, radius)
    level = 0.5 + _MOVED * paint.smooth_noise(size, generator)
    out = np.clip(_SHARPNESS * (soft - np.clip(level, 0.1, 0.9)) + 0.5, 0, 1)
    if generator.random() < _BITTEN:
        out *= 1 - paint.pattern(size, generator, 1.2)
    if generator.random() < _BITTEN:
        around = np.clip(4 * paint.blurred(mask, size // 8), 0, 1)
        out = np.maximum(out, around * paint.pattern(size, generator, 1.2))
    return out.astype(np.float32)
