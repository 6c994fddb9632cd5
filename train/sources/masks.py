"""The masks that the material's subnetworks learn on: as SegmentationNet finds them, and damaged.

A network that has seen true masks alone loses on estimated ones what it had gained
(docs/lab/2026-11-25-physics.md).
"""

import keras
import numpy as np

from lime_keras.data import clutter
from lime_keras.networks.registry import estimate

_ESTIMATED, _DAMAGED = 0.5, 0.25
"""Shares of the images with the network's own mask, and with a damaged one; the others' are true.
"""
_BLUR = (1, 4)
"""Smallest and largest radius, in pixels of 128, of the blur that edges of damaged masks move in.
"""
_MOVED = 0.35
"""Standard deviation of the level that an edge is cut at, about one half, along the edge."""
_SHARPNESS = 8.0
"""Slope of a damaged mask's edge over the coverage of its blur."""
_BITTEN = 0.3
"""Share of the damaged masks that lack a piece, and share of those that let a piece in."""


def seen(
    network: keras.Model | None,
    images: np.ndarray,
    masks: np.ndarray,
    generator: np.random.Generator,
) -> np.ndarray:
    """Return the masks that a batch's objects are cut out with, `(B, S, S, 1)` float32 in [0, 1].

    Args:
        network: SegmentationNet; without one, masks are true or damaged.
        images: `(B, S, S, 3)` sRGB in [0, 1].
        masks: true coverage `(B, S, S, 1)` in [0, 1].
        generator: source of all random numbers.
    """
    out = np.array(masks, np.float32)
    estimated = 0 if network is None else round(_ESTIMATED * len(out))
    if estimated:
        out[:estimated] = own(network, images[:estimated])
    for index in range(estimated, estimated + round(_DAMAGED * len(out))):
        out[index] = damaged(out[index], generator)
    return out


def own(network: keras.Model, images: np.ndarray) -> np.ndarray:
    """Return the masks that SegmentationNet finds in images, as other subnetworks see them."""
    answer = network.predict_on_batch(np.asarray(images))
    return keras.ops.convert_to_numpy(estimate("mask", network, answer, lambda name: None))


def damaged(mask: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return a mask `(S, S, 1)` whose edges have moved, and which may lack a piece or hold another.

    Smooth random fields decide where.
    """
    size = len(mask)
    radius = max(1, round(generator.uniform(*_BLUR) * size / 128))
    soft = clutter.blurred(mask, radius)
    level = 0.5 + _MOVED * clutter.smooth_noise(size, generator)
    out = np.clip(_SHARPNESS * (soft - np.clip(level, 0.1, 0.9)) + 0.5, 0, 1)
    if generator.random() < _BITTEN:
        out *= 1 - clutter.pattern(size, generator, 1.2)
    if generator.random() < _BITTEN:
        around = np.clip(4 * clutter.blurred(mask, size // 8), 0, 1)
        out = np.maximum(out, around * clutter.pattern(size, generator, 1.2))
    return out.astype(np.float32)
