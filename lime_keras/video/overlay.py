"""The overlay video: each frame with the object's outline, and a panel with its estimate."""

import functools

import av
import numpy as np
import OpenImageIO as oiio

from lime_keras.estimate import framing, preview
from lime_keras.material import Material
from lime_keras.optics import colour

_HEIGHT, _WIDEST = 480, 1280  # height, and largest width, of the shown frame in pixels
_PANEL, _SPHERE = 280, 192
_RAW, _FUSED, _SWATCH = 96, 186, (80, 34)
"""Left edges of the panel's two columns; width and height of a swatch."""
_PAPER, _INK, _FAINT, _OUTLINE = (24, 26, 30), (235, 235, 235), (150, 155, 165), (255, 225, 0)
_ROWS = {"red": 132, "green": 154, "blue": 176, "specular": 204, "exponent": 232, "coverage": 260}
"""Base line, in pixels from the top, of each of the panel's numbers."""


def draw(
    image_srgb: np.ndarray, seconds: float, status: str, estimate: Material, fused: Material
) -> np.ndarray:
    """Draw a frame and its panel side by side, `(480, w, 3)` uint8 sRGB, w even.

    Args:
        image_srgb: frame `(H, W, 3)`, uint8 sRGB.
        seconds: time of the frame in seconds since the first frame.
        status: short remark about the frame, such as `no object`.
        estimate: estimate of this frame; its layer `mask`, if it has one, is shown as an outline.
            The numbers that are None are not shown.
        fused: fused estimate, shown as a sphere if it is complete.
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
    """Draw the panel with swatches, numbers and a sphere, `(480, 280, 3)` uint8 sRGB.

    The arguments are those of `draw`.
    """
    pixels = _form().copy()
    for left, material in ((_RAW, estimate), (_FUSED, fused)):
        if material.diffuse_albedo is not None:
            swatch = colour.linear_to_srgb(np.clip(material.diffuse_albedo, 0, 1))
            pixels[72 : 72 + _SWATCH[1], left : left + _SWATCH[0]] = np.rint(255 * swatch)
    if fused.whole() is not None:
        left, top = (_PANEL - _SPHERE) // 2, _HEIGHT - _SPHERE - 10
        ball = np.rint(255 * preview.sphere(fused, _SPHERE))
        pixels[top : top + _SPHERE, left : left + _SPHERE] = ball
    lines = [(12, 30, f"{seconds:.2f} s", 18, _INK), (_RAW, 30, status, 18, _OUTLINE)]
    for column, material in ((_RAW, estimate), (_FUSED, fused)):
        lines += [(column, _ROWS[row], text, 17, _INK) for row, text in _numbers(material).items()]
    return _written(pixels, lines)


def _numbers(material: Material) -> dict[str, str]:
    """Return the text of the panel's rows for a material, by row."""
    texts: dict[str, str] = {}
    if material.diffuse_albedo is not None:
        texts = {
            name: f"{value:.3f}"
            for name, value in zip(("red", "green", "blue"), material.diffuse_albedo, strict=True)
        }
    if material.specular_albedo is not None:
        texts["specular"] = f"{material.specular_albedo:.3f}"
    if material.exponent is not None:
        texts["exponent"] = f"{material.exponent:.3g}"
    if material.mask_coverage is not None:
        texts["coverage"] = f"{material.mask_coverage:.1%}"
    return texts


@functools.cache
def _form() -> np.ndarray:
    """Return the panel with its headings and row names, without values."""
    pixels = np.full((_HEIGHT, _PANEL, 3), _PAPER, np.uint8)
    lines = [(12, y, row, 15, _FAINT) for row, y in _ROWS.items()]
    headings = [(12, 95, "diffuse"), (_RAW, 62, "this frame"), (_FUSED, 62, "fused")]
    return _written(pixels, lines + [(*heading, 15, _FAINT) for heading in headings])


def _written(pixels: np.ndarray, lines: list) -> np.ndarray:
    """Return pixels with lines of text, each (x, y of the base line, text, size, colour)."""
    image = oiio.ImageBuf(pixels)
    for x, y, text, size, ink in lines:
        if text:
            rgb = tuple(level / 255 for level in ink)
            oiio.ImageBufAlgo.render_text(image, x, y, text, size, "DroidSans", rgb)
    return np.asarray(image.get_pixels(oiio.UINT8))


def _resized(image: np.ndarray, width: int, height: int) -> np.ndarray:
    picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
    return picture.reformat(width=width, height=height, interpolation="AREA").to_ndarray()


def _outline(mask: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return the rim of a mask `(H, W, 1)` as bool `(height, width)`, two pixels wide."""
    rows = (np.arange(height) * mask.shape[0]) // height
    columns = (np.arange(width) * mask.shape[1]) // width
    return preview.rim(mask[rows[:, None], columns, 0] >= framing.THRESHOLD, 2)
