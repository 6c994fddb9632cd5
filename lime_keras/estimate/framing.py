"""Which square of a photo the networks look at, and the way from its pixels to theirs and back.

The networks were trained on objects that fill 0.55 to 0.92 of the frame around its middle
(render/scene/sampling.py). A photo is first looked at as a whole; if the object found there is
smaller, a square around it is looked at anew.
"""

from typing import NamedTuple

import numpy as np
import OpenImageIO as oiio
from scipy import ndimage

from lime_keras.optics import colour

FILL = 0.73
"""Share of a square's side that the object fills: the middle of what the networks know."""
_SMALLEST_FILL = 0.5
"""Below this the networks look again."""
THRESHOLD = 0.5
"""Coverage from which on a pixel belongs to the object."""


class Square(NamedTuple):
    """A square of whole pixels of a photo; it may reach beyond the photo's edges.

    Attributes:
        top: row of its first pixel.
        left: column of its first pixel.
        side: in pixels, at least 1.
    """

    top: int
    left: int
    side: int


def whole(height: int, width: int) -> Square:
    """The smallest square that holds all of a photo, in whose middle the photo lies."""
    side = max(height, width)
    return Square(-((side - height) // 2), -((side - width) // 2), side)


def around(mask: np.ndarray, square: Square) -> Square:
    """The square to look at, given what mask was found in another.

    Args:
        mask: `(S, S, 1)` coverage in [0, 1] of `square`.
        square: of the photo.

    Returns:
        `square` itself if nothing is in it, or the largest object fills enough of it; else a
        square in whose middle that object fills `FILL` of the side.
    """
    found, count = ndimage.label(mask[..., 0] >= THRESHOLD)
    if not count:
        return square
    largest = np.argmax(np.bincount(found.ravel())[1:])
    box = ndimage.find_objects(found)[largest]
    extent = max(edge.stop - edge.start for edge in box)
    if extent >= _SMALLEST_FILL * len(mask):
        return square
    return _centred(box, extent, square, square.side / len(mask))


def around_given(mask: np.ndarray) -> Square:
    """The square to look at, given the object's mask `(H, W, 1)` in the photo's own pixels.

    All that it covers counts as the object; an empty mask gives the whole photo.
    """
    box = ndimage.find_objects((mask[..., 0] >= THRESHOLD).astype(np.uint8))
    square = whole(*mask.shape[:2])
    if not box:
        return square
    extent = max(edge.stop - edge.start for edge in box[0])
    return _centred(box[0], extent, Square(0, 0, square.side), 1.0)


def _centred(box: tuple[slice, ...], extent: int, square: Square, scale: float) -> Square:
    """The square around a box of a grid whose pixels are `scale` of the photo's wide."""
    side = max(1, round(extent * scale / FILL))
    top, left = (
        round(origin + (edge.start + edge.stop) / 2 * scale - side / 2)
        for origin, edge in zip(square[:2], box, strict=True)
    )
    return Square(top, left, side)


def cut(image_srgb: np.ndarray, square: Square, size: int) -> np.ndarray:
    """Resample a square of a photo `(H, W, 3)`, sRGB, to `(size, size, 3)`.

    What lies beyond the photo repeats its edge. Made smaller, it is averaged over areas in linear
    light, as the training images are (`pipeline.resize`).
    """
    height, width = image_srgb.shape[:2]
    rows = np.clip(np.arange(square.top, square.top + square.side), 0, height - 1)
    columns = np.clip(np.arange(square.left, square.left + square.side), 0, width - 1)
    seen = image_srgb[rows[:, None], columns]
    if square.side == size:
        return seen
    linear = _resampled(colour.srgb_to_linear(seen), size, size)
    return np.clip(colour.linear_to_srgb(linear), seen.min(), seen.max())


def cut_layer(layer: np.ndarray, square: Square, size: int) -> np.ndarray:
    """Resample a square of a layer `(H, W, C)` to `(size, size, C)`; beyond its edges there is 0.

    For what is linear: masks and radiance.
    """
    seen = np.zeros((square.side, square.side, layer.shape[-1]), np.float32)
    inside, outside = _overlap(square, *layer.shape[:2])
    seen[inside] = layer[outside]
    return _resampled(seen, size, size)


def paste(layer: np.ndarray, square: Square, height: int, width: int) -> np.ndarray:
    """Bring a layer `(S, S, C)` of a square back to its photo's pixels, `(height, width, C)`.

    Between the layer's pixels it is linear, and outside the square 0.
    """
    out = np.zeros((height, width, layer.shape[-1]), np.float32)
    inside, outside = _overlap(square, height, width)
    rows, columns = (_shares(part, square.side, len(layer)) for part in inside)
    covered = out[outside]
    for channel in range(layer.shape[-1]):
        covered[..., channel] = rows @ layer[..., channel] @ columns.T
    return out


def _shares(pixels: slice, side: int, size: int) -> np.ndarray:
    """What each of `size` samples along a square's side gives to some of its pixels, `(P, size)`.

    A tent as wide as two samples, or, where those are finer, two pixels.
    """
    position = (np.arange(pixels.start, pixels.stop)[:, None] + 0.5) * size / side - 0.5
    distance = np.abs(np.arange(size) - position)
    tent = np.maximum(1 - distance / max(1, size / side), 0)
    return (tent / tent.sum(axis=1, keepdims=True)).astype(np.float32)


def _overlap(
    square: Square, height: int, width: int
) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Rows and columns of what a square and a photo share: of the square, and of the photo."""
    first = [max(0, -square.top), max(0, -square.left)]
    last = [min(square.side, height - square.top), min(square.side, width - square.left)]
    inside = tuple(slice(low, max(low, high)) for low, high in zip(first, last, strict=True))
    outside = tuple(
        slice(edge.start + origin, edge.stop + origin)
        for edge, origin in zip(inside, square[:2], strict=True)
    )
    return inside, outside


def _resampled(image: np.ndarray, height: int, width: int) -> np.ndarray:
    """A picture `(H, W, C)` in another size: areas averaged, or points joined linearly."""
    if image.shape[:2] == (height, width):
        return np.asarray(image, np.float32)
    channels = image.shape[-1]
    source = oiio.ImageBuf(oiio.ImageSpec(image.shape[1], image.shape[0], channels, oiio.FLOAT))
    source.set_pixels(oiio.ROI(), np.ascontiguousarray(image, np.float32))
    region = oiio.ROI(0, width, 0, height, 0, 1, 0, channels)
    kernel = "box" if len(image) > height else "triangle"
    resized = oiio.ImageBufAlgo.resize(source, filtername=kernel, roi=region)
    return np.asarray(resized.get_pixels(oiio.FLOAT)).reshape(height, width, channels)
