"""The contact sheet of a corpus: images, layers, environments and parameters of some examples."""

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lime_keras.data.corpus import Split
from lime_keras.io import atomic
from lime_keras.optics import colour, shininess

from . import exr_layers

_SHOWN = 24
_THUMB, _GAP, _MARGIN, _HEAD = 128, 6, 24, 84  # sizes on the page in pixels
_TEXT_WIDTH = 216
_SWATCH = 30
_PAPER, _INK, _FAINT = "#ffffff", "#1d2430", "#6b7482"
_LONGEST_NAME = 27


def write(corpus: Path, split: str, on_example: Callable[[int, int], None]) -> Path:
    """Write `preview.png` into a split's folder, and return its path.

    Args:
        corpus: folder of a corpus by `lime-render`.
        split: `train` or `test`.
        on_example: called with (done, total) as the records that are shown are read.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if a record that is shown is damaged.
    """
    files, shown = Split(corpus, split), []
    places = np.linspace(0, files.count - 1, min(files.count, _SHOWN)).astype(int).tolist()
    for place in places:
        shown.append(exr_layers.read(files, place))
        on_example(len(shown), len(places))
    page = draw(shown, files.count, f"{Path(corpus).resolve().name}/{split}")
    path = files.folder / "preview.png"
    with atomic.replacing(path) as partial:
        page.save(partial)
    return path


def draw(examples: Sequence[Mapping], count: int, title: str) -> Image.Image:
    """Draw a page of examples, one a row.

    Args:
        examples: parsed records (see `records.parse`) in NumPy.
        count: number of examples in the split.
        title: name of the corpus and the split.
    """
    width = 2 * _MARGIN + sum(across + _GAP for _, _, across in _PICTURES) + _TEXT_WIDTH
    height = _HEAD + len(examples) * (_THUMB + _GAP) + _MARGIN
    page = Image.new("RGB", (width, height), _PAPER)
    pen = ImageDraw.Draw(page)
    pen.text((_MARGIN, 12), title, _INK, _font(20))
    legend = (
        f"{len(examples)} of {count} examples. D, S, M and the environment E, seen from the "
        "camera, as sRGB of x / (1 + x); normals as (n + 1) / 2; the swatch is the diffuse albedo."
    )
    pen.text((_MARGIN, 40), legend, _FAINT, _font())
    for row, example in enumerate(examples):
        left, top = _MARGIN, _HEAD + row * (_THUMB + _GAP)
        for heading, picture, across in _PICTURES:
            if row == 0:
                pen.text((left, _HEAD - 20), heading, _INK, _font())
            thumb = Image.fromarray(_levels(picture(example)))
            page.paste(thumb.resize((across, _THUMB), Image.Resampling.BILINEAR), (left, top))
            left += across + _GAP
        pen.multiline_text((left + 4, top), "\n".join(words(example)), _INK, _font())
        albedo = colour.linear_to_srgb(example["diffuse_albedo"])
        corner = width - _MARGIN - _SWATCH, top + 2
        page.paste(tuple(_levels(albedo).tolist()), (*corner, corner[0] + _SWATCH, top + _SWATCH))
    return page


def words(example: Mapping) -> list[str]:
    """Return the parameters of an example in lines of text."""
    exponent, m_d = float(example["shininess"]), example["diffuse_albedo"]
    m_s, m_a = float(example["specular_albedo"]), float(example["ambient"])
    return [
        f"{int(example['index'])}",
        f"bin {int(shininess.bin_of(exponent)) + 1} of {shininess.BIN_COUNT}   s = {exponent:.3g}",
        "m_d = " + "  ".join(f"{value:.2f}" for value in m_d),
        f"m_s = {m_s:.2f}   m_a = {m_a:.3f}",
        f"coverage {float(example['mask'].mean()):.0%}",
        *(_shortened(example[name].decode()) for name in ("shape", "light")),
    ]


def _shortened(name: str) -> str:
    """Shorten a name so that it fits the column: the middle of a long name is left out."""
    if len(name) <= _LONGEST_NAME:
        return name
    kept = _LONGEST_NAME - 1
    return f"{name[: kept - kept // 2]}…{name[-(kept // 2) :]}"


def _levels(picture_srgb: np.ndarray) -> np.ndarray:
    return np.round(np.clip(picture_srgb, 0, 1) * 255).astype(np.uint8)


@functools.cache
def _font(size: int = 13) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size=size)


def _grey(radiance: np.ndarray) -> np.ndarray:
    """Return a layer `(H, W, 1)` as `(H, W, 3)`, sRGB of x / (1 + x)."""
    return np.repeat(colour.linear_to_srgb(radiance / (1 + radiance)), 3, axis=-1)


_PICTURES: tuple[tuple[str, Callable[[Mapping], np.ndarray], int], ...] = (
    ("Input", lambda example: example["image"], _THUMB),
    ("Mask", lambda example: np.repeat(example["mask"], 3, axis=-1), _THUMB),
    ("D", lambda one: _grey(one["diffuse_shading"]), _THUMB),
    ("S", lambda one: _grey(one["specular_shading"]), _THUMB),
    ("M", lambda one: _grey(one["mirror"]), _THUMB),
    ("Normals", lambda one: np.where(one["mask"] > 0, (one["normal"] + 1) / 2, 1.0), _THUMB),
    ("E", lambda one: _grey(one["environment"]), 2 * _THUMB),
)
"""Columns of the page: heading, function that returns a picture `(H, W, 3)`, sRGB in [0, 1], of an
example, and width of the thumbnail in pixels."""
