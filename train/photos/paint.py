"""Paint in a scene's linear light, before the camera: prints, clutter, shadows, other backgrounds.

The model has one material for each object; photographed ones bear labels, patterns and stains, and
are made of several materials. The subnetworks of the material learn from `prints` that these are no
highlights; m_d of a printed object stays that of the object. SegmentationNet learns from `clutter`
that the mask is that of the whole object.

An object's light is coverage × radiance, what is behind it (1 − coverage) × radiance. Factors of
light are drawn as factors of sRGB values, which look even to the eye (`_of_light`).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.random import Generator

from lime_keras.optics import colour

_PRINTED, _MOTTLED = 0.1, 0.1
"""Shares of the objects with one to three prints, and with small changes of their diffuse albedo.
"""
_LEVELS = 0.2, 1.8
"""Least and largest level of the noise from which on there is a print: on 42 to 4 %."""
_BRIGHTEST_ALBEDO = 0.9  # largest albedo of a print
_MOTTLING = 0.15  # largest standard deviation of the small changes, as a share of the albedo

_TEXTURED, _PARTED, _LABELLED = 0.3, 0.4, 0.4
"""Shares of the objects that wear another photo's scene, that are of two or three materials, and
that bear prints, in clutter."""
_CAMOUFLAGED, _STUDIO = 0.1, 0.1
"""Shares of the scenes whose background has the object's own colour, and of those before paper."""
_SHADED = 0.2  # share of the scenes with a shadow across them
_BRIGHTEST = 3.0  # largest factor from the object's shading to a print's, sRGB
_DARKEST = 0.25  # least factor of a shadow, sRGB
_CELLS, _COARSE = (2, 24), (1, 4)
"""Smallest and largest number of cells along an image of the noise that prints, and parts and
shadows, are cut from."""
_SHARPNESS = 12.0  # slope of a print's edge, per standard deviation of the noise
_EXPONENT = 2.2  # power of an sRGB value that its light is about

Scene = Mapping[str, Any]
"""`object` and `background`, linear light `(S, S, 3)`; `mask` and `diffuse_shading` `(S, S, 1)`;
`diffuse_albedo` `(3,)`."""


def prints(scene: Scene, generator: Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return an object's light with prints on it, `(S, S, 3)`, and where they are, `(S, S, 1)`.

    By Eq. 4 a print changes the radiance of a pixel by (m − m_d) · D; the highlights stay. The
    marks are 1 where the albedo is another than m_d, else 0.
    """
    mask, own = scene["mask"], np.asarray(scene["diffuse_albedo"], np.float32)
    change = _change(own, len(mask), generator)
    if change is None:
        return scene["object"], np.zeros_like(mask)
    light = np.maximum(scene["object"] + mask * scene["diffuse_shading"] * change, 0)
    marks = change.any(axis=-1, keepdims=True) & (mask > 0)
    return light.astype(np.float32), marks.astype(np.float32)


def _change(own: np.ndarray, size: int, generator: Generator) -> np.ndarray | None:
    """Return the change of the albedo at each pixel `(S, S, 3)`, or None for none."""
    albedo = np.broadcast_to(own, (size, size, 3))
    is_mottled, is_printed = generator.random(2) < (_MOTTLED, _PRINTED)
    if not (is_mottled or is_printed):
        return None
    if is_mottled:
        noise = smooth_noise(size, generator)
        tint = 1 + 0.5 * generator.uniform(-1, 1, 3).astype(np.float32)
        albedo = albedo * np.maximum(1 + generator.uniform(0, _MOTTLING) * noise * tint, 0)
    if is_printed:
        for _ in range(generator.integers(1, 4)):
            part = pattern(size, generator, generator.uniform(*_LEVELS))
            paint = generator.uniform(0, _BRIGHTEST_ALBEDO, 3).astype(np.float32)
            albedo = albedo + part * (paint - albedo)
    return (albedo - own).astype(np.float32)


def clutter(scene: Scene, other: np.ndarray, generator: Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return an object's light and that of what is behind it, each `(S, S, 3)`, both painted anew.

    New colours keep the object's shading: the largest of R, G and B at each pixel.

    Args:
        scene: features of the scene; its mask stays true.
        other: radiance of another scene, whose colours the object may wear, `(S, S, 3)`.
        generator: source of all random numbers.
    """
    painted = _painted(scene, other, generator)
    behind = _background(scene, painted, generator)
    if generator.random() < _SHADED:
        shadow = pattern(len(painted), generator, generator.uniform(-0.5, 1.0), _COARSE)
        dimmed = _of_light(1 - shadow * np.float32(generator.uniform(0, 1 - _DARKEST)))
        painted, behind = painted * dimmed, behind * dimmed
    return painted.astype(np.float32), behind.astype(np.float32)


def _painted(scene: Scene, other: np.ndarray, generator: Generator) -> np.ndarray:
    """Return the light of an object in other colours, `(S, S, 3)`."""
    out, mask = scene["object"], scene["mask"]
    shade = out.max(axis=-1, keepdims=True)
    if generator.random() < _TEXTURED:
        texture = np.rot90(other, int(generator.integers(4)))
        texture = texture[:, ::-1] if generator.random() < 0.5 else texture
        out = _brightened(shade, mask, generator.uniform(1, 1.5)) * np.minimum(texture, 1)
    if generator.random() < _PARTED:
        for _ in range(generator.integers(1, 3)):
            part = pattern(len(out), generator, generator.uniform(-0.3, 0.6), _COARSE)
            out = out + part * (_coloured(shade, mask, generator) - out)
    if generator.random() < _LABELLED:
        for _ in range(generator.integers(1, 4)):
            part = pattern(len(out), generator, generator.uniform(-0.5, 1.0))
            out = out + part * (_coloured(shade, mask, generator) - out)
    return out


def _coloured(shade: np.ndarray, mask: np.ndarray, generator: Generator) -> np.ndarray:
    """Return shading `(S, S, 1)` brightened at random, in a random colour, `(S, S, 3)`."""
    gain = np.exp(generator.uniform(0, np.log(_BRIGHTEST)))
    paint = colour.srgb_to_linear(generator.uniform(0, 1, 3)).astype(np.float32)
    return _brightened(shade, mask, gain) * paint


def _brightened(shade: np.ndarray, mask: np.ndarray, factor: float) -> np.ndarray:
    """Return shading with a factor of sRGB, no brighter than white or than it was."""
    return np.minimum(shade * np.float32(_of_light(factor)), np.maximum(shade, mask))


def _background(scene: Scene, painted: np.ndarray, generator: Generator) -> np.ndarray:
    """Return the light of what is behind an object, `(S, S, 3)`, which may be something else."""
    mask, chance = scene["mask"], generator.random()
    if chance < _CAMOUFLAGED:
        own = painted.sum((0, 1)) / max(mask.sum(), 1)
        shade = (painted + scene["background"]).mean(axis=-1, keepdims=True)
        gain = _of_light(1.5 * generator.uniform(0.5, 1.5)) * own / max(own.max(), 1e-4)
        return np.minimum(shade * gain.astype(np.float32), 1) * (1 - mask)
    if chance < _CAMOUFLAGED + _STUDIO:
        return paper(len(mask), generator) * (1 - mask)
    return scene["background"]


def paper(size: int, generator: Generator) -> np.ndarray:
    """Return the radiance of white, black or grey paper, `(size, size, 3)` float32 in [0, 1]."""
    grey = generator.choice([0.0, 1.0, generator.uniform()])
    lit = 0.05 * smooth_noise(size, generator, _COARSE) if grey else np.zeros((size, size, 1))
    srgb = np.clip(grey + lit, 0, 1)
    return np.repeat(colour.srgb_to_linear(srgb), 3, axis=-1).astype(np.float32)


def pattern(
    size: int, generator: Generator, level: float, cells: tuple[int, int] = _CELLS
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


def smooth_noise(size: int, generator: Generator, cells: tuple[int, int] = _CELLS) -> np.ndarray:
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


def blurred(mask: np.ndarray, radius: int) -> np.ndarray:
    """Return a mask `(S, S, 1)` averaged over squares of 2 · radius + 1 pixels, 0 outside."""
    out = np.pad(mask[..., 0], radius + 1)[:-1, :-1].cumsum(0).cumsum(1)
    width = 2 * radius + 1
    area = out[width:, width:] - out[:-width, width:] - out[width:, :-width] + out[:-width, :-width]
    return np.clip(area[..., None] / width**2, 0, 1)


def _of_light(factor: Any) -> Any:
    """Return the factor of linear light that looks like a factor of sRGB values."""
    return factor**_EXPONENT


def _between(size: int, cells: int) -> np.ndarray:
    """Return the matrix `(size, cells + 1)` that interpolates linearly between the cells' ends."""
    places = (np.arange(size, dtype=np.float32) + 0.5) * cells / size
    return np.maximum(0, 1 - np.abs(places[:, None] - np.arange(cells + 1, dtype=np.float32)))
