"""A video to look at: each frame with the object's outline, beside what was estimated of it."""

import functools
import math

import av
import numpy as np
import OpenImageIO as oiio

from lime_keras import colour, environment
from lime_keras.material import Material
from lime_keras.reflectance_map import disc, reflectance_map

_HEIGHT, _WIDEST = 480, 1280
"""Of the frame as it is shown, in pixels."""
_PANEL, _SPHERE = 280, 192
_RAW, _FUSED, _SWATCH = 96, 186, (80, 34)
"""Left edges of the panel's two columns; width and height of a swatch."""
_PAPER, _INK, _FAINT, _OUTLINE = (24, 26, 30), (235, 235, 235), (150, 155, 165), (255, 225, 0)
_MEAN_RADIANCE = 0.4
"""Of the light on the sphere: that of the training images."""
_ROWS = {"red": 132, "green": 154, "blue": 176, "specular": 204, "exponent": 232, "coverage": 260}
"""Base lines of the panel's numbers."""


def draw(
    image_srgb: np.ndarray, seconds: float, status: str, estimate: Material, fused: Material
) -> np.ndarray:
    """A frame and its panel side by side, `(480, W, 3)` uint8 sRGB, W even.

    Args:
        image_srgb: `(H, W, 3)` uint8.
        seconds: since the first frame.
        status: a word or two on the frame, such as `no object`.
        estimate: of this frame, with its `mask` among the layers; numbers that are None stay empty.
        fused: likewise, without layers; shown as a sphere if it is complete.
    """
    height, width, _ = image_srgb.shape
    scale = min(_HEIGHT / height, _WIDEST / width)
    shown = max(2, round(width * scale / 2) * 2), max(2, round(height * scale / 2) * 2)
    picture = _resized(image_srgb, *shown)
    if "mask" in estimate.layers:
        picture[_outline(estimate.layers["mask"], *shown)] = _OUTLINE
    canvas = np.full((_HEIGHT, shown[0] + _PANEL, 3), _PAPER, np.uint8)
    top = (_HEIGHT - shown[1]) // 2
    canvas[top : top + shown[1], : shown[0]] = picture
    canvas[:, shown[0] :] = panel(seconds, status, estimate, fused)
    return canvas


def panel(seconds: float, status: str, estimate: Material, fused: Material) -> np.ndarray:
    """Swatches, numbers and a sphere, `(480, 280, 3)` uint8 sRGB; arguments as of `draw`."""
    pixels = _form().copy()
    for left, material in ((_RAW, estimate), (_FUSED, fused)):
        if material.diffuse_albedo is not None:
            swatch = _bytes(np.clip(material.diffuse_albedo, 0, 1))
            pixels[72 : 72 + _SWATCH[1], left : left + _SWATCH[0]] = swatch
    ball = _ball(fused)
    left, top = (_PANEL - _SPHERE) // 2, _HEIGHT - _SPHERE - 10
    pixels[top : top + _SPHERE, left : left + _SPHERE][disc(_SPHERE)[..., 0] > 0] = ball
    lines = [(12, 30, f"{seconds:.2f} s", 18, _INK), (_RAW, 30, status, 18, _OUTLINE)]
    for column, material in ((_RAW, estimate), (_FUSED, fused)):
        lines += [(column, _ROWS[row], told, 17, _INK) for row, told in _numbers(material).items()]
    return _written(pixels, lines)


def _numbers(material: Material) -> dict[str, str]:
    """What the panel tells of a material, by row."""
    told: dict[str, str] = {}
    if material.diffuse_albedo is not None:
        told = {
            name: f"{value:.3f}"
            for name, value in zip(("red", "green", "blue"), material.diffuse_albedo, strict=True)
        }
    if material.specular_albedo is not None:
        told["specular"] = f"{material.specular_albedo:.3f}"
    if material.exponent is not None:
        told["exponent"] = f"{material.exponent:.3g}"
    if material.mask_coverage is not None:
        told["coverage"] = f"{material.mask_coverage:.1%}"
    return told


@functools.cache
def _form() -> np.ndarray:
    """The panel without its entries."""
    pixels = np.full((_HEIGHT, _PANEL, 3), _PAPER, np.uint8)
    lines = [(12, y, row, 15, _FAINT) for row, y in _ROWS.items()]
    headings = [(12, 95, "diffuse"), (_RAW, 62, "this frame"), (_FUSED, 62, "fused")]
    return _written(pixels, lines + [(*heading, 15, _FAINT) for heading in headings])


def _written(pixels: np.ndarray, lines: list) -> np.ndarray:
    """Pixels with lines of text, each (x, y of the base line, text, size, colour)."""
    height, width, channels = pixels.shape
    image = oiio.ImageBuf(oiio.ImageSpec(width, height, channels, oiio.UINT8))
    image.set_pixels(oiio.ROI(), pixels)
    for x, y, text, size, ink in lines:
        if text:
            told = tuple(level / 255 for level in ink)
            oiio.ImageBufAlgo.render_text(image, x, y, text, size, "DroidSans", told)
    return np.asarray(image.get_pixels(oiio.UINT8))


def _ball(material: Material) -> np.ndarray:
    """Pixels `(P, 3)` uint8 inside `disc`: the material in the studio, or blank if incomplete."""
    albedo, specular, exponent = (
        material.diffuse_albedo,
        material.specular_albedo,
        material.exponent,
    )
    if albedo is None or specular is None or exponent is None:
        return np.array(_PAPER, np.uint8)
    # To what the eye tells apart: fused estimates soon settle, and need not be shaded anew.
    levels = tuple(round(256 * float(value)) / 256 for value in (*albedo, specular))
    return _shaded(*levels, round(math.log10(exponent), 2))


@functools.lru_cache(maxsize=1)
def _shaded(
    red: float, green: float, blue: float, specular: float, log_exponent: float
) -> np.ndarray:
    """As `_ball`, from its numbers."""
    batch = [np.array([value], np.float32) for value in (10.0**log_exponent, specular, 0.0)]
    albedo = np.array([[red, green, blue]], np.float32)
    seen = reflectance_map(_studio(), batch[0], albedo, batch[1], batch[2], _SPHERE)
    return _bytes(np.asarray(seen)[0][disc(_SPHERE)[..., 0] > 0])


@functools.cache
def _studio() -> np.ndarray:
    """The light on the sphere, `(1, 64, 128, 1)`: a window, a strip and a lamp in a dim room."""
    x, y, z = np.moveaxis(environment.directions(*environment.STORED_SHAPE), -1, 0)
    radiance = 0.15 + 0.1 * y
    across, up = np.arctan2(x, z), np.arcsin(y)
    window = (np.abs(across + 0.7) < 0.35) & (np.abs(up - 0.6) < 0.3)
    strip = (np.abs(across - 1.5) < 0.12) & (np.abs(up) < 0.8)
    lamp = np.hypot(across - 0.5, up - 0.9) < 0.06
    radiance = radiance + 6.0 * window + 4.0 * strip + 25.0 * lamp
    scaled = radiance * (_MEAN_RADIANCE / environment.spherical_mean(radiance))
    return scaled.astype(np.float32)[None, ..., None]


def _resized(image: np.ndarray, width: int, height: int) -> np.ndarray:
    picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
    return picture.reformat(width=width, height=height, interpolation="AREA").to_ndarray()


def _outline(mask: np.ndarray, width: int, height: int) -> np.ndarray:
    """Where the rim of a mask `(H, W, 1)` runs in an image of another size, two pixels wide."""
    rows = (np.arange(height) * mask.shape[0]) // height
    columns = (np.arange(width) * mask.shape[1]) // width
    inside = mask[rows[:, None], columns, 0] >= 0.5
    core = inside
    for _ in range(2):
        around = np.pad(core, 1, mode="edge")
        across = around[1:-1, :-2] & around[1:-1, 2:]
        core = core & across & around[:-2, 1:-1] & around[2:, 1:-1]
    return inside & ~core


def _bytes(linear: np.ndarray) -> np.ndarray:
    """Linear radiance as uint8 sRGB, clipped."""
    return np.rint(255 * colour.linear_to_srgb(np.clip(linear, 0, 1))).astype(np.uint8)
