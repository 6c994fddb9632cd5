"""The overlay video: each frame with the object's outline, and a panel with its estimate."""

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lime_keras.estimate import framing, preview
from lime_keras.material import Material

_HEIGHT, _WIDEST = 480, 1280  # height, and largest width, of the shown frame in pixels
_PANEL, _SPHERE, _MARGIN, _SWATCH = 380, 192, 12, 20
_PAPER, _INK, _OUTLINE = (24, 26, 30), (235, 235, 235), (255, 225, 0)
_TOPS = {"this frame": 44, "fused": 158}
"""Rows at which the panel's two estimates begin."""


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
    canvas = Image.new("RGB", (shown[0] + _PANEL, _HEIGHT), _PAPER)
    place = 0, (_HEIGHT - shown[1]) // 2
    canvas.paste(Image.fromarray(image_srgb).resize(shown, Image.Resampling.BILINEAR), place)
    if "mask" in estimate.layers:
        mask = Image.fromarray(estimate.layers["mask"][..., 0] >= framing.THRESHOLD)
        inside = np.asarray(mask.resize(shown, Image.Resampling.NEAREST))
        canvas.paste(_OUTLINE, place, Image.fromarray(preview.rim(inside, 2)))
    canvas.paste(Image.fromarray(panel(seconds, status, estimate, fused)), (shown[0], 0))
    return np.array(canvas)


def panel(seconds: float, status: str, estimate: Material, fused: Material) -> np.ndarray:
    """Draw the panel with swatches, numbers and a sphere, `(480, 380, 3)` uint8 sRGB.

    The arguments are those of `draw`.
    """
    canvas = Image.new("RGB", (_PANEL, _HEIGHT), _PAPER)
    pen, font = ImageDraw.Draw(canvas), ImageFont.load_default(size=14)
    pen.text((_MARGIN, 12), f"{seconds:.2f} s", _INK, font)
    pen.text((_PANEL // 3, 12), status, _OUTLINE, font)
    for (title, top), material in zip(_TOPS.items(), (estimate, fused), strict=True):
        if material.diffuse_srgb_hex is not None:
            box = (_MARGIN, top, _MARGIN + _SWATCH, top + _SWATCH)
            pen.rectangle(box, material.diffuse_srgb_hex)
        lines = [title, *preview.caption(material.to_json())]
        pen.multiline_text((2 * _MARGIN + _SWATCH, top), "\n".join(lines), _INK, font, spacing=8)
    if fused.whole() is not None:
        sphere = np.rint(255 * preview.sphere(fused, _SPHERE)).astype(np.uint8)
        canvas.paste(
            Image.fromarray(sphere), ((_PANEL - _SPHERE) // 2, _HEIGHT - _SPHERE - _MARGIN)
        )
    return np.asarray(canvas)
