"""The clutter augmentation: prints on the objects, and other objects behind them.

It is for SegmentationNet alone. Photographed objects bear labels, letters and stains, and stand
among others; their mask is that of the whole object, and of no other. The remaining subnetworks
learn from scenes of the model, which has one material for each object.
"""

import numpy as np

_PRINTED = 0.5
"""Share of the objects that bear prints."""
_ACCOMPANIED = 0.4
"""Share of the scenes that show another object behind theirs."""
_LARGEST = 0.5
"""Largest visible part of another object, in areas of the scene's own object."""
_BRIGHTEST = 3.0
"""Largest factor from the object's shading to a print's, sRGB."""
_CELLS = (2, 24)
"""Smallest and largest number of cells of the noise along an image that prints are cut from."""
_SHARPNESS = 12.0
"""Slope of a print's edge, per standard deviation of the noise."""


def add(
    images: np.ndarray, masks: np.ndarray, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Put clutter into a batch of images.

    A print has a colour of its own and the object's shading, brighter or darker. The object of the
    next example in the batch, shifted, is pasted behind the scene's own.

    Args:
        images: `(B, S, S, 3)` sRGB in [0, 1].
        masks: coverage of the objects `(B, S, S, 1)` in [0, 1]; they stay true.
        generator: source of all random numbers.

    Returns:
        The images with clutter, `(B, S, S, 3)` float32 sRGB in [0, 1], and for each whether another
        object was pasted into it, `(B,)` bools.
    """
    images, masks = np.asarray(images, np.float32), np.asarray(masks, np.float32)
    printed = np.stack(
        [
            _printed(image, mask, generator) if generator.random() < _PRINTED else image
            for image, mask in zip(images, masks, strict=True)
        ]
    )
    out, pasted = printed.copy(), np.zeros(len(images), bool)
    for index in np.flatnonzero(generator.random(len(images)) < _ACCOMPANIED):
        size = images.shape[1]
        down, right = (int(n) for n in generator.integers(-size // 2, size // 2 + 1, 2))
        other = (index + 1) % len(images)
        share = _shifted(masks[other], down, right) * (1 - masks[index])
        if 0 < share.sum() <= _LARGEST * masks[index].sum():
            pasted[index] = True
            out[index] += share * (_shifted(printed[other], down, right) - printed[index])
    return out, pasted


def _printed(image: np.ndarray, mask: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return an image `(S, S, 3)` whose object bears one to three prints."""
    shade = image.max(axis=-1, keepdims=True)
    out = image
    for _ in range(generator.integers(1, 4)):
        gain = np.exp(generator.uniform(0, np.log(_BRIGHTEST)))
        colour = generator.uniform(0, 1, 3).astype(np.float32)
        painted = np.minimum(shade * np.float32(gain), 1) * colour
        out = out + mask * _pattern(len(image), generator) * (painted - out)
    return out


def _pattern(size: int, generator: np.random.Generator) -> np.ndarray:
    """Return where a print is, `(size, size, 1)` in [0, 1]: noise, cut at a random level."""
    low, high = np.log(_CELLS)
    rows, columns = np.exp(generator.uniform(low, high, 2)).astype(int)
    noise = generator.standard_normal((rows + 1, columns + 1)).astype(np.float32)
    smooth = _between(size, rows) @ noise @ _between(size, columns).T
    level = generator.uniform(-0.5, 1.0)
    return np.clip(_SHARPNESS * (smooth - level) + 0.5, 0, 1)[..., None].astype(np.float32)


def _between(size: int, cells: int) -> np.ndarray:
    """Return the matrix `(size, cells + 1)` that interpolates linearly between the cells' ends."""
    places = (np.arange(size, dtype=np.float32) + 0.5) * cells / size
    return np.maximum(0, 1 - np.abs(places[:, None] - np.arange(cells + 1, dtype=np.float32)))


def _shifted(image: np.ndarray, down: int, right: int) -> np.ndarray:
    """Return an image `(S, S, C)` moved by whole pixels, 0 where nothing comes in."""
    out = np.zeros_like(image)
    rows, columns = _moved(len(image), down), _moved(len(image), right)
    out[rows[1], columns[1]] = image[rows[0], columns[0]]
    return out


def _moved(size: int, by: int) -> tuple[slice, slice]:
    """Return which part of `size` pixels stays visible when they move, and where it comes to."""
    source = slice(max(-by, 0), size - max(by, 0))
    return source, slice(source.start + by, source.stop + by)
