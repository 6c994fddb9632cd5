"""The contact sheet of a corpus: images, layers, environments and parameters of examples."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from skimage.transform import resize

from lime_keras.optics import colour, shininess

_DPI = 100
_THUMB, _GAP, _MARGIN, _HEAD = 128, 6, 24, 84  # sizes on the page in pixels
_BLOCKS = 2
_TEXT_WIDTH = 216
_LINE = 17
_SWATCH = 30
_PAPER, _INK, _FAINT = "#ffffff", "#1d2430", "#6b7482"
_LONGEST_NAME = 27


def draw(examples: Sequence[Mapping], count: int, title: str) -> Figure:
    """Draw a page of examples.

    `Figure.savefig` writes the page without resampling: a thumbnail's pixel is a pixel of the file.

    Args:
        examples: parsed records (see `records.parse`) in NumPy.
        count: number of examples in the split.
        title: name of the corpus and the split.
    """
    rows = math.ceil(len(examples) / _BLOCKS)
    width = 2 * _MARGIN + _BLOCKS * _block_width() + (_BLOCKS - 1) * 2 * _MARGIN
    height = _HEAD + rows * (_THUMB + _GAP) + _MARGIN
    page = np.full((height, width, 3), 1.0)
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=_PAPER)

    def write(x: float, y: float, text: str, **style: Any) -> None:
        """Write text with its top left corner at a pixel."""
        defaults: dict[str, Any] = {"fontsize": 9, "color": _INK, "va": "top"}
        figure.text(x / width, 1 - y / height, text, **(defaults | style))

    write(_MARGIN, 16, title, fontsize=15, fontweight="bold")
    write(
        _MARGIN,
        40,
        f"{len(examples)} of {count} examples. D, S, M and the environment E, seen from the "
        "camera, as sRGB of x / (1 + x); normals as (n + 1) / 2; the swatch is the diffuse albedo.",
        color=_FAINT,
    )
    for position, example in enumerate(examples):
        block, row = divmod(position, rows)
        left = _MARGIN + block * (_block_width() + 2 * _MARGIN)
        top = _HEAD + row * (_THUMB + _GAP)
        x = left
        for heading, picture, across in _PICTURES:
            if row == 0:
                write(x, _HEAD - 20, heading, fontweight="bold")
            thumb = resize(picture(example), (_THUMB, across), anti_aliasing=True)
            page[top : top + _THUMB, x : x + across] = thumb
            x += across + _GAP
        _describe(write, page, x + 4, top, example)
    figure.figimage(page, origin="upper")
    return figure


def _describe(write: Callable, page: np.ndarray, x: int, y: int, example: Mapping) -> None:
    """Write the parameters of an example, and draw a patch of its diffuse albedo."""
    exponent, m_d = float(example["shininess"]), example["diffuse_albedo"]
    patch = np.clip(colour.linear_to_srgb(m_d), 0, 1)
    corner = x + _TEXT_WIDTH - _SWATCH - 4
    page[y + 2 : y + 2 + _SWATCH, corner : corner + _SWATCH] = patch
    m_s, m_a = float(example["specular_albedo"]), float(example["ambient"])
    write(x, y + 3, f"{int(example['index'])}", fontweight="bold")
    lines = (
        f"bin {int(shininess.bin_of(exponent)) + 1} of {shininess.BIN_COUNT}   s = {exponent:.3g}",
        "m_d = " + "  ".join(f"{value:.2f}" for value in m_d),
        f"m_s = {m_s:.2f}   m_a = {m_a:.3f}",
        f"coverage {float(example['mask'].mean()):.0%}",
    )
    names = [_shortened(example[name].decode()) for name in ("shape", "light")]
    for number, text in enumerate((*lines, *names)):
        colour_of_line = _INK if number < len(lines) else _FAINT
        write(x, y + 3 + (number + 1) * _LINE, text, color=colour_of_line)


def _shortened(name: str) -> str:
    """Shorten a name so that it fits the column: the middle of a long name is left out."""
    if len(name) <= _LONGEST_NAME:
        return name
    kept = _LONGEST_NAME - 1
    return f"{name[: kept - kept // 2]}…{name[-(kept // 2) :]}"


def _block_width() -> int:
    return sum(across + _GAP for _, _, across in _PICTURES) + _TEXT_WIDTH


def _grey(name: str) -> Callable[[Mapping], np.ndarray]:
    """Return a function that shows the layer `name` of an example as sRGB of x / (1 + x)."""

    def picture(example: Mapping) -> np.ndarray:
        radiance = example[name]
        return np.repeat(colour.linear_to_srgb(radiance / (1 + radiance)), 3, axis=-1)

    return picture


def _normals(example: Mapping) -> np.ndarray:
    """Return the normals as colours, white outside the object."""
    inside = example["mask"] > 0
    return np.where(inside, np.clip((example["normal"] + 1) / 2, 0, 1), 1.0)


_PICTURES: tuple[tuple[str, Callable[[Mapping], np.ndarray], int], ...] = (
    ("Input", lambda example: example["image"], _THUMB),
    ("Mask", lambda example: np.repeat(example["mask"], 3, axis=-1), _THUMB),
    ("D", _grey("diffuse_shading"), _THUMB),
    ("S", _grey("specular_shading"), _THUMB),
    ("M", _grey("mirror"), _THUMB),
    ("Normals", _normals, _THUMB),
    ("E", _grey("environment"), 2 * _THUMB),
)
"""Columns of the page: heading, function that returns a picture `(H, W, 3)`, sRGB in [0, 1], of an
example, and width of the thumbnail in pixels."""
