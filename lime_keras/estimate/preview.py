"""The preview of an estimate: its layers, the recomposed object, and a sphere of the material."""

import functools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lime_keras.estimate import framing
from lime_keras.estimate.framing import Square
from lime_keras.material import Material
from lime_keras.optics import colour, gloss, studio_light
from lime_keras.optics.compositing import compose_image
from lime_keras.optics.reflectance_map import disc, sphere_shading

TILE = 320  # height and width of a picture on a page, in pixels
_COLUMNS = 3
_MARGIN, _TITLE = 10, 26
_WIDTH = _MARGIN + _COLUMNS * (TILE + _MARGIN)
"""Width of a page: it is read on a screen of 1,000 pixels without being made smaller."""
_ROOM = 14  # pixels around the sphere in its tile
_PAPER, _INK = (250, 250, 251), (29, 36, 48)
_BACKGROUND = 0.16  # linear radiance of the grey behind the sphere
_CAUTION = (168, 72, 0)
_LINE = 20  # height of a line of warnings in pixels
_OUTLINE = np.array([1.0, 0.25, 0.1], np.float32)
_TITLES = {
    "photo": "photo and mask",
    "recomposed": "m_d · D + m_s · S",
    "diffuse": "diffuse part",
    "specular_shading": "specular shading S",
    "mirror": "mirror image M",
}


def sphere(material: Material, size: int) -> np.ndarray:
    """Render a sphere of the material in the studio (`lime_keras.optics.studio_light`).

    The sphere is shaded by Eqs. 2–4; its rim is averaged from twice the size.

    Args:
        material: estimate with albedos and exponent.
        size: height and width of the picture in pixels.

    Returns:
        Picture `(size, size, 3)` float32, sRGB in [0, 1], grey beside the sphere.

    Raises:
        ValueError: if the estimate holds no albedos or no exponent.
    """
    whole = material.whole()
    if whole is None:
        raise ValueError("a sphere needs a whole material: estimate `albedo` and `exponent`")
    # Rounded for the cache, to a twentieth of a decade: the eye sees no difference.
    log_exponent = round(20 * math.log10(max(whole.exponent, 1e-3))) / 20
    radiance = compose_image(whole, *(layer[0] for layer in _shaded(log_exponent, size)))
    covered = disc(2 * size).reshape(size, 2, size, 2, 1).mean((1, 3))
    linear = _BACKGROUND + covered * (np.clip(radiance, 0, 1) - _BACKGROUND)
    return colour.linear_to_srgb(linear).astype(np.float32)


@functools.lru_cache(maxsize=64)
def _shaded(log_exponent: float, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return D and S of the sphere in the studio, each `(1, size, size, 1)`, linear radiance."""
    light = studio_light.light()[None, ..., None].astype(np.float32)
    exponent = np.array([10.0**log_exponent], np.float32)
    return sphere_shading(light, exponent, size)


def sheet(image_srgb: np.ndarray, material: Material) -> np.ndarray:
    """Draw all parts of an estimate, three in a row, with its numbers and warnings below.

    Args:
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        material: estimate from the photo, with the layer `mask`.

    Returns:
        Picture `(h, 1000, 3)` float32, sRGB in [0, 1].
    """
    shown = tiles(image_srgb, material)
    written = [(_INK, line) for line in caption(material.to_json())]
    for caution in material.warnings:
        written += [(_CAUTION, line) for line in _lines(caution.message)]

    # The tiles, row by row, each below its title.
    below = _MARGIN + math.ceil(len(shown) / _COLUMNS) * (_TITLE + TILE)
    height = below + _MARGIN + len(written) * _LINE + _MARGIN
    page = Image.new("RGB", (_WIDTH, height), _PAPER)
    pen = ImageDraw.Draw(page)
    for index, (title, tile) in enumerate(shown.items()):
        left, top = place(index)
        pen.text((left, top - _TITLE + 4), title, fill=_INK, font=_font())
        levels = np.round(np.clip(tile, 0, 1) * 255).astype(np.uint8)
        page.paste(Image.fromarray(levels), (left, top))

    # The numbers, then the warnings.
    for index, (ink, line) in enumerate(written):
        pen.text((_MARGIN, below + _MARGIN + index * _LINE), line, fill=ink, font=_font())
    return np.asarray(page, np.float32) / 255


def place(index: int) -> tuple[int, int]:
    """Return the left column and the top row of a tile on a page."""
    row, column = divmod(index, _COLUMNS)
    return _MARGIN + column * (TILE + _MARGIN), _MARGIN + row * (_TITLE + TILE) + _TITLE


def tiles(image_srgb: np.ndarray, material: Material) -> dict[str, np.ndarray]:
    """Return the parts of an estimate as pictures, by title, in the order of the preview.

    Args:
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        material: estimate from the photo, with the layer `mask`.

    Returns:
        Pictures `(320, 320, 3)`, sRGB in [0, 1]: the photo with the mask's outline, of the square
        that the networks saw; if the material is whole, a sphere of it; and the layers that there
        are. What lies beyond the photo has the colour of the page.
    """
    height, width = image_srgb.shape[:2]
    square = Square(*material.square) if material.square else framing.whole(height, width)
    inside, paper = framing.inside(square, height, width, TILE), np.array(_PAPER, np.float32) / 255
    edge = rim(_crop(material.layers["mask"], square)[..., 0] >= framing.THRESHOLD)
    photo = np.where(edge[..., None], _OUTLINE, _crop(image_srgb, square, is_photo=True))
    shown = {_TITLES["photo"]: np.where(inside, photo, paper)}
    if material.whole() is not None:
        # With some of its background around it.
        ball, room = sphere(material, TILE - 2 * _ROOM), (_ROOM, _ROOM)
        grey = colour.linear_to_srgb(_BACKGROUND)
        shown["in a studio"] = np.pad(ball, (room, room, (0, 0)), constant_values=grey)
    for name, title in list(_TITLES.items())[1:]:
        if name in material.layers:
            tile = _crop(material.layers[name], square)
            # S and M are far brighter than white, so their bright parts are compressed.
            linear = tile / (1 + tile) if tile.shape[-1] == 1 else np.clip(tile, 0, 1)
            shown[title] = np.where(inside, colour.linear_to_srgb(linear), paper)
    if "reflectance_map" in material.layers:
        tile = colour.linear_to_srgb(np.clip(material.layers["reflectance_map"], 0, 1))
        tile = tile.astype(np.float32)
        shown["reflectance map"] = framing.cut(tile, framing.whole(*tile.shape[:2]), TILE)
    return shown


def rim(inside: np.ndarray, width: int = 1) -> np.ndarray:
    """Return the outermost pixels of a shape, bool `(H, W)`; the picture's edge is no rim."""
    core = inside
    for _ in range(width):
        around = np.pad(core, 1, mode="edge")
        across = around[1:-1, :-2] & around[1:-1, 2:]
        core = core & across & around[:-2, 1:-1] & around[2:, 1:-1]
    return inside & ~core


def caption(numbers: Mapping[str, Any]) -> list[str]:
    """Return the numbers of `Material.to_json` in lines: in words, in numbers, then the mask."""
    words = [numbers[name] for name in ("gloss", "diffuse_srgb_hex") if name in numbers]
    parts, mask = [], []
    if "diffuse_albedo" in numbers:
        red, green, blue = numbers["diffuse_albedo"]
        parts.append(f"m_d {red:.2f} {green:.2f} {blue:.2f}")
    if "specular_albedo" in numbers:
        parts.append(f"m_s {numbers['specular_albedo']:.2f}")
    if "exponent" in numbers:
        parts.append(gloss.numbers(numbers["exponent"], numbers.get("exponent_interval")))
    if "mask_coverage" in numbers:
        covered = numbers["mask_coverage"]
        mask.append(f"covers {covered:.1%}" if covered else "no object")
    if "mask_confidence" in numbers:
        mask.append(f"mask confidence {numbers['mask_confidence']:.2f}")
    return ["    ".join(line) for line in (words, parts, mask) if line]


def _crop(image: np.ndarray, square: Square, *, is_photo: bool = False) -> np.ndarray:
    """Return a square of a linear layer, or of a photo in sRGB, as a tile.

    Pillow takes a fifth of the time of `framing.cut`, and rounds otherwise.
    """
    # Of a large image, every n-th pixel: at least two are left per pixel of the tile.
    step = max(1, square.side // (2 * TILE))
    image, square = image[::step, ::step], Square(*(edge // step for edge in square))
    inside, outside = framing.overlap(square, *image.shape[:2])
    if not image[outside].size:  # an object that was found beyond the photo's edge alone
        return np.zeros((TILE, TILE, image.shape[2]), np.float32)
    part = colour.srgb_to_linear(image[outside]) if is_photo else image[outside]
    beyond = [(edge.start, square.side - edge.stop) for edge in inside]
    padded = np.pad(part, [*beyond, (0, 0)], mode="edge" if is_photo else "constant")
    how = Image.Resampling.BOX if square.side > TILE else Image.Resampling.BILINEAR
    planes = np.ascontiguousarray(np.moveaxis(padded, -1, 0), np.float32)
    resized = [Image.fromarray(plane).resize((TILE, TILE), how) for plane in planes]
    tile = np.stack([np.asarray(plane) for plane in resized], axis=-1)
    return colour.linear_to_srgb(tile) if is_photo else tile


@functools.lru_cache(maxsize=64)
def _lines(text: str) -> list[str]:
    """Return the lines of a warning on a page."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and _font().getlength(f"! {longer}") <= _WIDTH - 2 * _MARGIN:
            lines[-1] = longer
        else:
            lines.append(word)
    return [("  " if index else "! ") + line for index, line in enumerate(lines)]


@functools.cache
def _font() -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size=15)
