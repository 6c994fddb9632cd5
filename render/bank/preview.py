"""The preview of a bank: some of its G-buffers, all of its lights and its textures on one page."""

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from skimage.transform import resize

from lime_keras.io import atomic
from lime_keras.optics import colour, octahedral
from lime_keras.synthesis import bank
from lime_keras.synthesis.geometry import GeometryBank
from lime_keras.synthesis.lights import LightBank

SHOWN = 100
"""Number of G-buffers on the page."""
_DPI = 100
_THUMB, _GAP, _MARGIN, _HEAD = 128, 6, 24, 48
"""Sizes on the page in pixels."""
_ACROSS = 14
_TEXTURE = 61
"""Width of a texture: two and a gap are as wide as a G-buffer."""
_WIDTH = 2 * _MARGIN + _ACROSS * (_THUMB + _GAP) - _GAP
_KINDS = {"photograph": "photographs", "room": "rooms", "sky": "skies"}
_PAPER, _INK, _FAINT = "#ffffff", "#1d2430", "#6b7482"


def preview(folder: Path, out: Path) -> None:
    """Draw a page of a bank: G-buffers spread evenly over it, its lights and its textures.

    Args:
        folder: folder by `lime-render bank`.
        out: PNG file to write.

    Raises:
        FileNotFoundError: if the bank is incomplete or a file is missing.
        ValueError: if a file is broken.
    """
    geometry, lights = GeometryBank(folder), LightBank(folder)
    textures = bank.textures(folder)
    shown = np.linspace(0, len(geometry) - 1, min(SHOWN, len(geometry))).astype(int)
    kinds = ", ".join(f"{lights.kinds.count(k)} {named}" for k, named in _KINDS.items())
    sections = (
        (
            f"{len(shown)} of {len(geometry)} G-buffers",
            "Normals as (n + 1) / 2; where a pixel sees two surfaces, their mean by share.",
            [_normals(geometry, int(index)) for index in shown],
        ),
        (
            f"{len(lights)} lights",
            f"{kinds}, in this order, as sRGB of x / (1 + x).",
            [_light(lights.map(number)) for number in range(len(lights))],
        ),
        (
            f"{len(textures)} textures",
            "",
            [resize(one / 255, (_TEXTURE, _TEXTURE), anti_aliasing=True) for one in textures],
        ),
    )
    # Names of folders may have dollar signs, which Matplotlib would take for formulas.
    with matplotlib.rc_context({"text.parse_math": False}):
        figure = _page(folder.resolve().name, sections)
        with atomic.replacing(out) as partial:
            figure.savefig(partial, format="png")


def _page(title: str, sections: Sequence[tuple[str, str, list[np.ndarray]]]) -> Figure:
    """Draw headings and pictures, those of a section all of one size, row by row."""
    height = _HEAD + sum(_HEAD + _rows(pictures)[1] for _, _, pictures in sections) + _MARGIN
    page = np.full((height, _WIDTH, 3), 1.0)
    figure = Figure(figsize=(_WIDTH / _DPI, height / _DPI), dpi=_DPI, facecolor=_PAPER)

    def write(y: float, text: str, **style: object) -> None:
        figure.text(_MARGIN / _WIDTH, 1 - y / height, text, va="top", **style)  # type: ignore[arg-type]

    write(16, title, fontsize=15, fontweight="bold", color=_INK)
    top = _HEAD
    for heading, note, pictures in sections:
        write(top + 6, heading, fontsize=11, fontweight="bold", color=_INK)
        write(top + 24, note, fontsize=9, color=_FAINT)
        top += _HEAD
        across, tall = _rows(pictures)
        down, wide = pictures[0].shape[:2]
        for number, picture in enumerate(pictures):
            row, column = divmod(number, across)
            y, x = top + row * (down + _GAP), _MARGIN + column * (wide + _GAP)
            page[y : y + down, x : x + wide] = picture
        top += tall
    figure.figimage(page, origin="upper")
    return figure


def _rows(pictures: list[np.ndarray]) -> tuple[int, int]:
    """Return the number of pictures in a row, and the height of all rows in pixels."""
    down, wide = pictures[0].shape[:2]
    across = (_WIDTH - 2 * _MARGIN + _GAP) // (wide + _GAP)
    return across, math.ceil(len(pictures) / across) * (down + _GAP)


def _normals(geometry: GeometryBank, index: int) -> np.ndarray:
    """Return the normals of an entry as colours, over white, `(_THUMB, _THUMB, 3)`."""
    gbuffer = {name: value[0] for name, value in geometry.read(np.array([index])).items()}
    first, second = octahedral.decode(gbuffer["normal"])
    share = gbuffer["share"][..., None] / 255
    coverage = gbuffer["coverage"][..., None] / 255
    normal = share * first + (1 - share) * second
    picture = coverage * np.clip((normal + 1) / 2, 0, 1) + 1 - coverage
    return resize(picture, (_THUMB, _THUMB), anti_aliasing=True)


def _light(radiance: np.ndarray) -> np.ndarray:
    """Return a map as sRGB of x / (1 + x), `(_THUMB / 2, _THUMB, 3)`."""
    down = len(radiance) * 2 // _THUMB
    small = radiance.reshape(_THUMB // 2, down, _THUMB, down).mean(axis=(1, 3))
    return np.repeat(colour.linear_to_srgb(small / (1 + small))[..., None], 3, axis=-1)
