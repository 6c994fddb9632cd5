"""Guided upsampling: layers of the networks' size, whose edges become those of the photo.

In a window of a few pixels of the networks a layer is nearly linear in the photo's colours: exactly
so for the mask of an object of one colour before a background of another. These linear functions
are fitted at the networks' size, as those of the guided filter are (He, Sun and Tang 2013; He and
Sun 2015, "Fast Guided Filter"). They turn the photo's detail, which the networks did not see, into
detail of the layer, which is added to the interpolated layer. Where the colours say nothing, the
layer stays as it is. No value leaves the range of the layer's values around it: there are no halos,
and the photo's texture stays out of where the layer has no edge.
"""

import itertools
from collections.abc import Iterator

import numpy as np

from lime_keras.estimate import framing
from lime_keras.estimate.framing import Square
from lime_keras.optics.dynamic_range import compress, expand

_NOISE_OF_MASK, _NOISE_OF_RADIANCE = 0.03, 0.2
"""Contrast of a window's colours, sRGB, below which they do not shape a mask, or S and M.

A mask is either 0 or 1, so that nearly all contrast at its edge is its own. S and M have soft edges
within the object; texture, and noise, should not become theirs.
"""
_TILE = 128
"""Height and width in pixels of the parts that are computed one after the other.

They need little memory, and their products of matrices are so small that BLAS starts no threads,
which would take a hundred times as long.
"""


def mask(
    image_srgb: np.ndarray, square: Square, guide_srgb: np.ndarray, low_mask: np.ndarray
) -> np.ndarray:
    """Upsample the mask of a square to its photo.

    Args:
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        square: square of the photo that the networks saw.
        guide_srgb: its content at the networks' size `(S, S, 3)`, sRGB in [0, 1] (`framing.cut`).
        low_mask: its mask `(S, S, 1)` in [0, 1].

    Returns:
        Coverage `(H, W, 1)` float32 in [0, 1], 0 outside the square.
    """
    everywhere = np.ones_like(low_mask)
    return _guided(image_srgb, square, guide_srgb, low_mask, everywhere, _NOISE_OF_MASK)


def radiance(
    image_srgb: np.ndarray,
    square: Square,
    guide_srgb: np.ndarray,
    low_mask: np.ndarray,
    layer: np.ndarray,
    full_mask: np.ndarray,
) -> np.ndarray:
    """Upsample a layer of radiance, 0 outside the mask, to its photo.

    The edge of the object is that of `full_mask`: the layer is first freed of the mask of the
    networks' size, and continued beyond it.

    Args:
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        square: square of the photo that the networks saw.
        guide_srgb: its content at the networks' size `(S, S, 3)`, sRGB in [0, 1] (`framing.cut`).
        low_mask: its mask `(S, S, 1)` in [0, 1].
        layer: radiance `(S, S, 1)`, linear and at least 0, such as S or M.
        full_mask: coverage `(H, W, 1)` in [0, 1] of the photo.

    Returns:
        Radiance `(H, W, 1)` float32, linear, 0 where `full_mask` is 0 and outside the square.
    """
    inside = (low_mask >= framing.THRESHOLD).astype(np.float32)
    # The networks' layers are masked in this domain, and photos are nearly linear in it.
    unmasked = inside * compress(layer) / np.maximum(low_mask, framing.THRESHOLD)
    around = _box_sum(inside, 2)
    beyond = _box_sum(unmasked, 2) / np.maximum(around, 1)
    continued = np.where(inside > 0, unmasked, beyond).astype(np.float32)
    out = _guided(image_srgb, square, guide_srgb, continued, inside, _NOISE_OF_RADIANCE)
    for rows in range(0, len(out), _TILE):
        part = slice(rows, rows + _TILE)
        out[part] = expand(out[part] * full_mask[part])
    return out


def _guided(
    image: np.ndarray,
    square: Square,
    guide: np.ndarray,
    layer: np.ndarray,
    weights: np.ndarray,
    noise: float,
) -> np.ndarray:
    """Return a layer `(S, S, 1)` of the square in the photo's pixels, `(H, W, 1)` float32."""
    slopes = _slopes(guide, layer, weights, noise)
    low, high = _range(layer)
    known = np.concatenate([layer, low, high, slopes, guide], axis=-1, dtype=np.float32)
    planes = np.ascontiguousarray(known.transpose(2, 0, 1))
    out = np.zeros((*image.shape[:2], 1), np.float32)
    inside, _ = framing.overlap(square, *image.shape[:2])
    for tile in itertools.product(*map(_parts, inside)):
        rows, columns = (framing.shares(part, square.side, len(layer)) for part in tile)
        value, least, most, *others = _interpolated(planes, rows, columns)
        if not most.any():
            continue
        there = tuple(
            slice(part.start + origin, part.stop + origin)
            for part, origin in zip(tile, square[:2], strict=True)
        )
        for channel, (slope, blurred) in enumerate(zip(others[:3], others[3:], strict=True)):
            value += slope * (image[there][..., channel] - blurred)
        np.clip(value, least, most, out=out[there][..., 0])
    return out


def _parts(pixels: slice) -> Iterator[slice]:
    """Yield a slice of pixels in parts of at most `_TILE`."""
    for start in range(pixels.start, pixels.stop, _TILE):
        yield slice(start, min(start + _TILE, pixels.stop))


def _interpolated(planes: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> list[np.ndarray]:
    """Return each plane of `(C, S, S)` at P × Q pixels that have weights `(P, S)` and `(Q, S)`."""
    # Only few of the samples have a part in a tile.
    down, across = (
        slice(used[0], used[-1] + 1)
        for used in (np.flatnonzero(shares.any(axis=0)) for shares in (rows, columns))
    )
    return [rows[:, down] @ plane[down, across] @ columns[:, across].T for plane in planes]


def _slopes(guide: np.ndarray, layer: np.ndarray, weights: np.ndarray, noise: float) -> np.ndarray:
    """Return the gradient `(S, S, 3)` of the layer by the photo's colours, by least squares.

    Each fit is over the 3 × 3 pixels around. The guided filter takes the mean of neighbouring fits,
    for a smooth result; here it made the mask's error half as large again.
    """
    colours, values = guide.astype(np.float64), layer.astype(np.float64)
    total = _box_sum(weights.astype(np.float64), 1)

    def mean(quantity: np.ndarray) -> np.ndarray:
        return _box_sum(weights * quantity, 1) / np.maximum(total, 1)

    middle = mean(colours)
    products = mean((colours[..., :, None] * colours[..., None, :]).reshape(*guide.shape[:2], 9))
    spread = products.reshape(*guide.shape[:2], 3, 3) - middle[..., :, None] * middle[..., None, :]
    together = mean(colours * values) - middle * mean(values)
    return np.linalg.solve(spread + noise**2 * np.eye(3), together[..., None])[..., 0]


def _range(layer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest value of a layer `(S, S, 1)` in each 3 × 3 pixels."""
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(layer, [(1, 1), (1, 1), (0, 0)], mode="edge"), (3, 3), (0, 1)
    )
    return windows.min((-2, -1)), windows.max((-2, -1))


def _box_sum(image: np.ndarray, reach: int) -> np.ndarray:
    """Return the sum over the pixels of `(S, S, C)` up to `reach` away; 0 lies beyond the edges."""
    padded = np.pad(image, [(reach, reach), (reach, reach), (0, 0)])
    side = 2 * reach + 1
    return np.lib.stride_tricks.sliding_window_view(padded, (side, side), (0, 1)).sum((-2, -1))
