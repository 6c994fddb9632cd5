"""The square of a photo that the networks see, and resampling into this square and back.

The networks expect an object that fills 0.55 to 0.92 of the frame around its middle, as test images
have it (`NARROW` in render/scene/sampling.py; training draws more widely). First they see the whole
photo. If the object found there is smaller, they see a square around it.
"""

from typing import Any, NamedTuple

import cc3d
import numpy as np
import OpenImageIO as oiio

from lime_keras.optics import colour

FILL = 0.73  # share of a square's side that the object fills, as in the middle test image
_SMALLEST_FILL = 0.5  # share of a square's side below which the networks see a smaller square
_PART = 2**22  # pixels of a square that are padded and averaged at a time
THRESHOLD = 0.5  # smallest coverage, in [0, 1], of a pixel that belongs to the object


_LEVELS = np.arange(256, dtype=np.float32) / np.float32(255)  # the sRGB levels of uint8, in [0, 1]
_LINEAR = colour.srgb_to_linear(_LEVELS)  # their linear radiance
_LARGEST_FILL = 0.9  # share of a square's side from which a followed object has outgrown it
_Beyond = tuple[tuple[int, int], ...]


class Square(NamedTuple):
    """A square of whole pixels of a photo; it may reach beyond the photo's edges.

    Attributes:
        top: row of the first pixel.
        left: column of the first pixel.
        side: width and height in pixels, at least 1.
    """

    top: int
    left: int
    side: int


def whole(height: int, width: int) -> Square:
    """Return the smallest square that contains a whole photo, with the photo in its middle.

    Example:
        >>> whole(60, 100)
        Square(top=-20, left=0, side=100)
    """
    side = max(height, width)
    return Square(-((side - height) // 2), -((side - width) // 2), side)


def around(mask: np.ndarray, square: Square) -> Square:
    """Return the square for a closer view of the object in `square`.

    Args:
        mask: coverage `(S, S, 1)` in [0, 1] of `square`.
        square: square of the photo that the mask shows.

    Returns:
        `square` itself if the mask shows no object, or if the largest object fills at least half
        of its side. Else a square around that object, which fills `FILL` of its side.
    """
    largest = _largest_object(mask)
    if largest is None or largest[1] >= _SMALLEST_FILL * len(mask):
        return square
    return _centred(*largest, square, square.side / len(mask))


def _largest_object(mask: np.ndarray) -> tuple[tuple[slice, ...], int] | None:
    """Return the box of the largest object of a mask, and its longer side; None without one."""
    labels = cc3d.connected_components(mask[..., 0] >= THRESHOLD, connectivity=4)
    objects = cc3d.statistics(labels)
    # The first is what belongs to no object.
    pixels, boxes = objects["voxel_counts"][1:], objects["bounding_boxes"][1:]
    if not boxes:
        return None
    box = boxes[np.argmax(pixels)]
    return box, max(edge.stop - edge.start for edge in box)


def following(mask: np.ndarray, square: Square, height: int, width: int) -> Square | None:
    """Return the square in which to look for an object in the next frame of a stream.

    Args:
        mask: coverage `(S, S, 1)` in [0, 1] of `square`.
        square: square of this frame.
        height: height of the frame in pixels.
        width: width of the frame in pixels.

    Returns:
        A square around the largest object, which fills `FILL` of its side, or the whole frame's if
        that is smaller; None if the mask shows no object, or one that reaches the square's edge
        where the frame goes on, or fills more of the square than the networks have seen.
    """
    object_box = _largest_object(mask)
    if object_box is None:
        return None
    box, extent = object_box
    size, everything = len(mask), whole(height, width)
    within = (slice(1, size - 1),) * 2
    cut_off = any(
        (edge.start < limits.start and origin > 0) or (edge.stop > limits.stop and end < length)
        for edge, limits, origin, end, length in zip(
            box,
            within,
            square[:2],
            (square.top + square.side, square.left + square.side),
            (height, width),
            strict=True,
        )
    )
    if square != everything and (cut_off or extent > _LARGEST_FILL * size):
        return None
    closer = _centred(box, extent, square, square.side / size)
    return closer if closer.side < _SMALLEST_FILL / FILL * everything.side else everything


def around_mask(mask: np.ndarray) -> Square:
    """Return the square around the object of a photo's mask; the object fills `FILL` of its side.

    All that the mask covers counts as the object. An empty mask gives the square of the whole
    photo.

    Args:
        mask: coverage `(H, W, 1)` in [0, 1] in the photo's own pixels.
    """
    inside = mask[..., 0] >= THRESHOLD
    square = whole(*mask.shape[:2])
    if not inside.any():
        return square
    lit = (np.flatnonzero(inside.any(axis)) for axis in (1, 0))
    box = tuple(slice(int(edge[0]), int(edge[-1]) + 1) for edge in lit)
    extent = max(edge.stop - edge.start for edge in box)
    return _centred(box, extent, Square(0, 0, square.side), 1.0)


def _centred(box: tuple[slice, ...], extent: int, square: Square, scale: float) -> Square:
    """Return the square around a box; a pixel of the box's grid is `scale` pixels of the photo."""
    side = max(1, round(extent * scale / FILL))
    top, left = (
        round(origin + (edge.start + edge.stop) / 2 * scale - side / 2)
        for origin, edge in zip(square[:2], box, strict=True)
    )
    return Square(top, left, side)


def cut(image_srgb: np.ndarray, square: Square, size: int) -> np.ndarray:
    """Resample a square of a photo to `(size, size, 3)`, sRGB in [0, 1].

    Beyond the photo its edge is repeated. A larger square is averaged over areas in linear light,
    as the training images are (`pipeline.resize`).

    Args:
        image_srgb: photo `(H, W, 3)`, sRGB, in [0, 1] or uint8; both give the same bits.
        square: square of the photo.
        size: height and width of the result in pixels.
    """
    height, width = image_srgb.shape[:2]
    top, left, side = square
    # A square wholly beyond the photo still sees its nearest edge.
    rows = slice(min(max(top, 0), height - 1), max(min(top + side, height), 1))
    columns = slice(min(max(left, 0), width - 1), max(min(left + side, width), 1))
    content = image_srgb[rows, columns]
    first = [min(max(-edge, 0), side - 1) for edge in (top, left)]
    last = [side - count - edge for count, edge in zip(content.shape[:2], first, strict=True)]
    beyond = (*zip(first, last, strict=True), (0, 0))
    levels = _LEVELS if content.dtype == np.uint8 else None
    if side == size:
        return np.pad(content if levels is None else levels[content], beyond, mode="edge")
    # A frame's 256 levels are looked up: the power of each pixel takes ten times as long.
    linear = colour.srgb_to_linear(content) if levels is None else _LINEAR[content]
    if side > size:
        resampled = _shrunk(linear, beyond, size, "edge")
    else:
        resampled = _enlarged(np.pad(linear, beyond, mode="edge"), size)
    resampled = colour.linear_to_srgb(resampled)
    least, most = content.min(), content.max()
    return np.clip(resampled, *((least, most) if levels is None else levels[[least, most]]))


def cut_layer(layer: np.ndarray, square: Square, size: int) -> np.ndarray:
    """Resample a square of a linear layer, such as a mask or radiance, to `(size, size, C)`.

    Beyond the layer's edges the result is 0.

    Args:
        layer: layer `(H, W, C)` of linear values.
        square: square of the photo.
        size: height and width of the result in pixels.
    """
    inside, outside = overlap(square, *layer.shape[:2])
    content = np.asarray(layer[outside], np.float32)
    if not content.size:
        return np.zeros((size, size, layer.shape[-1]), np.float32)
    beyond = (*((part.start, square.side - part.stop) for part in inside), (0, 0))
    if square.side > size:
        return _shrunk(content, beyond, size, "constant")
    padded = np.pad(content, beyond)
    return padded if square.side == size else _enlarged(padded, size)


def paste(layer: np.ndarray, square: Square, height: int, width: int) -> np.ndarray:
    """Resample a square's layer of linear values `(S, S, C)` to its photo, `(height, width, C)`.

    The result is interpolated linearly inside the square, and 0 outside.
    """
    out = np.zeros((height, width, layer.shape[-1]), np.float32)
    inside, outside = overlap(square, height, width)
    rows, columns = (shares(part, square.side, len(layer)) for part in inside)
    covered = out[outside]
    for channel in range(layer.shape[-1]):
        covered[..., channel] = rows @ layer[..., channel] @ columns.T
    return out


def inside(square: Square, height: int, width: int, size: int) -> np.ndarray:
    """Return which of `(size, size, 1)` samples of a square have their middle inside its photo.

    The photo has `height` × `width` pixels.
    """
    middle = (np.arange(size) + 0.5) * square.side / size
    rows, columns = square.top + middle, square.left + middle
    across = (columns >= 0) & (columns <= width)
    return (((rows >= 0) & (rows <= height))[:, None] & across)[..., None]


def shares(pixels: slice, side: int, size: int) -> np.ndarray:
    """Return the weights `(P, size)` of the samples along a square's side for P of its pixels.

    They interpolate linearly, and each row sums to 1. The kernel is a tent with a base of two
    samples, or of two pixels if the samples are finer.
    """
    position = (np.arange(pixels.start, pixels.stop)[:, None] + 0.5) * size / side - 0.5
    distance = np.abs(np.arange(size) - position)
    tent = np.maximum(1 - distance / max(1, size / side), 0)
    return (tent / tent.sum(axis=1, keepdims=True)).astype(np.float32)


def overlap(square: Square, height: int, width: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return the overlap of a square and a photo as slices of the square and of the photo."""
    first = [max(0, -square.top), max(0, -square.left)]
    last = [min(square.side, height - square.top), min(square.side, width - square.left)]
    inside = tuple(slice(low, max(low, high)) for low, high in zip(first, last, strict=True))
    outside = tuple(
        slice(edge.start + origin, edge.stop + origin)
        for edge, origin in zip(inside, square[:2], strict=True)
    )
    return inside, outside


def _enlarged(image: np.ndarray, size: int) -> np.ndarray:
    """Interpolate `(S, S, C)` linearly to `(size, size, C)`."""
    channels = image.shape[-1]
    source = oiio.ImageBuf(np.ascontiguousarray(image, np.float32))
    region = oiio.ROI(0, size, 0, size, 0, 1, 0, channels)
    resized = oiio.ImageBufAlgo.resize(source, filtername="triangle", roi=region)
    return np.asarray(resized.get_pixels(oiio.FLOAT)).reshape(size, size, channels)


def _shrunk(image: np.ndarray, beyond: _Beyond, size: int, mode: Any) -> np.ndarray:
    """Average the areas of an image `(H, W, C)`, padded to a larger square, to `(size, size, C)`.

    The square is padded and averaged by parts, as that of a long photo is many times as large.
    """
    rows, columns, channels = beyond
    step = max(1, _PART // (rows[0] + len(image) + rows[1]))
    parts = []
    for first in range(0, image.shape[1], step):
        part = np.pad(image[:, first : first + step], (rows, (0, 0), channels), mode=mode)
        parts.append(_averaged(part, size, 0))
    across = np.pad(np.concatenate(parts, axis=1), ((0, 0), columns, channels), mode=mode)
    return _averaged(across, size, 1)


def _averaged(image: np.ndarray, size: int, axis: int) -> np.ndarray:
    """Make an image smaller along an axis: each new pixel is the mean of those in its area.

    These are OpenImageIO's means with the filter `box`, whose single precision decides about a
    pixel on the edge of two areas, in a third of its time.
    """
    side, single = image.shape[axis], np.float32
    ratio = single(size / side)
    centre = (np.arange(size, dtype=single) + single(0.5)) * single(1 / size) * single(side)
    nearest = np.floor(centre)
    reach = int(np.ceil(single(0.5) / ratio))
    taps = np.arange(-reach, reach + 1, dtype=single)
    inside = np.abs(ratio * (taps - (centre - nearest - single(0.5))[:, None])) <= 0.5
    first = nearest.astype(int) - reach + inside.argmax(axis=1)
    count = inside.sum(axis=1)
    # `reduceat` sums from each index to the next: each area, and then what lies before the next.
    edges = np.stack([first, first + count], axis=1).ravel()[:-1]
    sums = np.add.reduceat(image, edges, axis=axis, dtype=single)
    area = count.astype(single).reshape([-1 if at == axis else 1 for at in range(image.ndim)])
    return sums[::2] / area if axis == 0 else sums[:, ::2] / area
