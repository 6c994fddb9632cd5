"""The clutter augmentation: objects in many colours, prints, shadows, and other backgrounds.

It is for SegmentationNet alone. Photographed objects bear labels and paint, and are made of several
materials; their mask is that of the whole object. The remaining subnetworks learn from scenes of
the model, which has one material for each object.
"""

import numpy as np

_TEXTURED = 0.3
"""Share of the objects that wear another scene's image as their colours."""
_PARTED = 0.4
"""Share of the objects that are of two or three materials."""
_PRINTED = 0.4
"""Share of the objects that bear prints."""
_CAMOUFLAGED = 0.1
"""Share of the scenes whose background has the object's own colour."""
_STUDIO = 0.1
"""Share of the scenes before white, black or grey paper."""
_SHADED = 0.2
"""Share of the scenes with a shadow across them."""
_BRIGHTEST = 3.0
"""Largest factor from the object's shading to a print's, sRGB."""
_DARKEST = 0.25
"""Least factor of a shadow, sRGB."""
_CELLS, _COARSE = (2, 24), (1, 4)
"""Smallest and largest number of cells along an image of the noise that prints, and parts and
shadows, are cut from."""
_SHARPNESS = 12.0
"""Slope of a print's edge, per standard deviation of the noise."""


def add(images: np.ndarray, masks: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Put clutter into a batch of images.

    An object's new colours keep its shading: the largest of R, G and B at each pixel.

    Args:
        images: `(B, S, S, 3)` sRGB in [0, 1].
        masks: coverage of the objects `(B, S, S, 1)` in [0, 1]; they stay true.
        generator: source of all random numbers.

    Returns:
        The images with clutter, `(B, S, S, 3)` float32 sRGB in [0, 1].
    """
    images, masks = np.asarray(images, np.float32), np.asarray(masks, np.float32)
    out = np.empty_like(images)
    for row, (image, mask) in enumerate(zip(images, masks, strict=True)):
        painted = image + mask * (_painted(image, images[row - 1], generator) - image)
        behind = _behind(painted, mask, generator)
        out[row] = behind + mask * (painted - behind)
    for index in np.flatnonzero(generator.random(len(images)) < _SHADED):
        shadow = pattern(images.shape[1], generator, generator.uniform(-0.5, 1.0), _COARSE)
        out[index] *= 1 - shadow * np.float32(generator.uniform(0, 1 - _DARKEST))
    return out


def pattern(
    size: int,
    generator: np.random.Generator,
    level: float,
    cells: tuple[int, int] = _CELLS,
) -> np.ndarray:
    """Return where smooth noise is above a level, `(size, size, 1)` float32 in [0, 1].

    Args:
        size: height and width in pixels.
        generator: source of all random numbers.
        level: the level, in standard deviations of the noise's nodes.
        cells: smallest and largest number of the noise's cells along the image.
    """
    noise = smooth_noise(size, generator, cells)
    return np.clip(_SHARPNESS * (noise - level) + 0.5, 0, 1).astype(np.float32)


def smooth_noise(
    size: int, generator: np.random.Generator, cells: tuple[int, int] = _CELLS
) -> np.ndarray:
    """Return noise between standard normal nodes, linear in each cell, `(size, size, 1)`.

    Args:
        size: height and width in pixels.
        generator: source of all random numbers.
        cells: smallest and largest number of cells along the image.
    """
    low, high = np.log(cells)
    rows, columns = np.exp(generator.uniform(low, high, 2)).astype(int)
    noise = generator.standard_normal((rows + 1, columns + 1)).astype(np.float32)
    return (_between(size, rows) @ noise @ _between(size, columns).T)[..., None]


def paper(size: int, generator: np.random.Generator) -> np.ndarray:
    """Return white, black or grey paper, `(size, size, 3)` float32 sRGB in [0, 1]."""
    grey = generator.choice([0.0, 1.0, generator.uniform()])
    lit = 0.05 * smooth_noise(size, generator, _COARSE) if grey else 0.0
    grain = generator.normal(0, 0.01, (size, size, 3))
    return np.clip(grey + lit + grain, 0, 1).astype(np.float32)


def blurred(mask: np.ndarray, radius: int) -> np.ndarray:
    """Return a mask `(S, S, 1)` averaged over squares of 2 · radius + 1 pixels, 0 outside."""
    out = np.pad(mask[..., 0], radius + 1)[:-1, :-1].cumsum(0).cumsum(1)
    width = 2 * radius + 1
    area = out[width:, width:] - out[:-width, width:] - out[width:, :-width] + out[:-width, :-width]
    return np.clip(area[..., None] / width**2, 0, 1)


def _painted(image: np.ndarray, other: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return an image `(S, S, 3)` painted all over; only the object's part of it counts."""
    shade = image.max(axis=-1, keepdims=True)
    out = image
    if generator.random() < _TEXTURED:
        out = np.minimum(shade * np.float32(generator.uniform(1, 1.5)), 1) * _turned(
            other, generator
        )
    if generator.random() < _PARTED:
        for _ in range(generator.integers(1, 3)):
            part = pattern(len(image), generator, generator.uniform(-0.3, 0.6), _COARSE)
            out = out + part * (_coloured(shade, generator) - out)
    if generator.random() < _PRINTED:
        for _ in range(generator.integers(1, 4)):
            part = pattern(len(image), generator, generator.uniform(-0.5, 1.0))
            out = out + part * (_coloured(shade, generator) - out)
    return out


def _coloured(shade: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return shading `(S, S, 1)` brightened at random, in a random colour, `(S, S, 3)`."""
    gain = np.exp(generator.uniform(0, np.log(_BRIGHTEST)))
    colour = generator.uniform(0, 1, 3).astype(np.float32)
    return np.minimum(shade * np.float32(gain), 1) * colour


def _behind(image: np.ndarray, mask: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return the background of an image `(S, S, 3)`, which may be another."""
    chance = generator.random()
    if chance < _CAMOUFLAGED:
        own = (image * mask).sum((0, 1)) / max(mask.sum(), 1)
        shade = image.mean(axis=-1, keepdims=True)
        gain = generator.uniform(0.5, 1.5) * own / max(own.max(), 1e-3)
        return np.minimum(shade * gain.astype(np.float32) * 1.5, 1)
    if chance < _CAMOUFLAGED + _STUDIO:
        return paper(len(image), generator)
    return image


def _turned(image: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return an image `(S, S, 3)` turned by quarters and mirrored at random."""
    turned = np.rot90(image, int(generator.integers(4)))
    return turned[:, ::-1] if generator.random() < 0.5 else turned


def _between(size: int, cells: int) -> np.ndarray:
    """Return the matrix `(size, cells + 1)` that interpolates linearly between the cells' ends."""
    places = (np.arange(size, dtype=np.float32) + 0.5) * cells / size
    return np.maximum(0, 1 - np.abs(places[:, None] - np.arange(cells + 1, dtype=np.float32)))
