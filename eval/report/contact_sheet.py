"""Contact sheets of photos with a model's answers, sorted by gloss, as JPEG."""

import bisect
import functools
import io
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from lime_keras.optics import colour

from ..photos.answers import OWN, Answers
from ..photos.folder import Photo
from ..photos.summary import by_gloss
from .themes import Theme

PER_SHEET = 24
"""Largest number of photos on a sheet."""
_TILE, _GAP, _LINE = 176, 8, 20
_CHIPS = {"glossy": "#2f74b5", "matte": "#8a6d3b"}
_SHOWN = (
    "photo and mask",
    "specular shading S",
    "mirror image M",
    "reflectance map",
    "in a studio",
)
"""Titles of the pictures that a sheet shows, out of those of `preview.tiles`."""


CAPTION = (
    "The photos, the glossiest first by m_s · c(s) of the first model with its own mask. The two "
    "swatches before the numbers are the colours of m_d and of the object's mean pixel, at full "
    "brightness. S and M are compressed as x / (1 + x); the sphere is the material in a studio."
)
"""Explanation of a sheet."""


def sheets(
    photos: Sequence[Photo], answers: Answers, summary: Mapping[str, Any]
) -> list[Callable[[Theme], bytes]]:
    """Return the sheets of the answers with the models' own masks, glossiest photo first.

    Each photo has a row of pictures for each model, with the numbers below: those of the own mask
    and, where there is one, of the given mask.

    Args:
        photos: photos that were evaluated.
        answers: answers for these photos.
        summary: result of `summary.summarise` for them.

    Returns:
        For each sheet, of at most `PER_SHEET` photos, a function that draws it as JPEG.
    """
    order = by_gloss(answers)
    rows: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in summary["photos"]:
        rows.setdefault((row["photo"], row["model"]), []).append(row)
    models = list(dict.fromkeys(model for model, _ in answers.columns))
    shown = {title for pictures in answers.pictures.values() for title in pictures}
    titles = [title for title in _SHOWN if title in shown]

    def draw(start: int, theme: Theme) -> bytes:
        cards = []
        for rank, position in enumerate(order[start : start + PER_SHEET], start + 1):
            photo = photos[position]
            panels = {
                model: (answers.pictures[model, position], rows[photo.name, model])
                for model in models
            }
            cards.append(_card(rank, photo, panels, titles, theme))
        heading = (
            f"Photos {start + 1} to {start + len(cards)} of {len(order)} by m_s · c(s) of "
            f"{models[0]} with its own mask. Swatches: m_d, the object's mean pixel."
        )
        return _jpeg(_page(heading, cards, 2 if len(models) == 1 else 1, theme))

    return [functools.partial(draw, start) for start in range(0, len(order), PER_SHEET)]


def _card(
    rank: int,
    photo: Photo,
    panels: Mapping[str, tuple[Mapping[str, np.ndarray], Sequence[Mapping[str, Any]]]],
    titles: Sequence[str],
    theme: Theme,
) -> Image.Image:
    """Draw a photo: its name and finish, and the panel of each model side by side."""
    panel_width = len(titles) * (_TILE + _GAP) - _GAP
    width = len(panels) * (panel_width + 3 * _GAP) - 3 * _GAP
    lines = max(len(rows) for _, rows in panels.values())
    height = 2 * _LINE + _TILE + _GAP // 2 + lines * _LINE
    card = Image.new("RGB", (width, height), theme.paper)
    pen = ImageDraw.Draw(card)
    left = 0
    if photo.finish:
        left = _width(photo.finish) + 12
        pen.rounded_rectangle((0, 1, left, _LINE - 1), 5, fill=_CHIPS[photo.finish])
        pen.text((6, 1), photo.finish, fill="#ffffff", font=_font())
        left += _GAP
    notes = [photo.name, *(["dielectric"] if photo.dielectric else []), photo.note]
    text = f"{rank}. " + ", ".join(filter(None, notes))
    pen.text((left, 1), _fitted(text, width - left), fill=theme.ink, font=_font())
    for index, (model, (pictures, rows)) in enumerate(panels.items()):
        begin = index * (panel_width + 3 * _GAP)
        for column, title in enumerate(titles):
            left = begin + column * (_TILE + _GAP)
            named = model if len(panels) > 1 and not column else title
            pen.text((left, _LINE), _fitted(named, _TILE), fill=theme.ink, font=_font(13))
            if title in pictures:
                tile = Image.fromarray(pictures[title]).resize((_TILE, _TILE), Image.Resampling.BOX)
                card.paste(tile, (left, 2 * _LINE))
            else:
                box = (left, 2 * _LINE, left + _TILE - 1, 2 * _LINE + _TILE - 1)
                pen.rectangle(box, outline=theme.faint)
        for line, row in enumerate(rows):
            top = 2 * _LINE + _TILE + _GAP // 2 + line * _LINE
            _numbers(pen, (begin, top), row, theme)
    return card


def _numbers(
    pen: ImageDraw.ImageDraw, place: tuple[int, int], row: Mapping[str, Any], theme: Theme
) -> None:
    """Write the numbers of one answer, with the swatches of its colours, in one line."""
    left, top = place
    for name in ("diffuse_albedo", "object_colour"):
        rgb = np.array(row[name], float)
        if np.all(np.isfinite(rgb)) and rgb.max() > 0:
            srgb = colour.linear_to_srgb(rgb / rgb.max())
            fill = tuple(int(level) for level in np.round(255 * np.clip(srgb, 0, 1)))
            pen.rectangle((left, top + 3, left + 22, top + 16), fill=fill, outline=theme.faint)
        left += 24
    if row["exponent"] is None:
        text = "no answer"
    else:
        red, green, blue = row["diffuse_albedo"]
        text = (
            f"m_d {red:.2f} {green:.2f} {blue:.2f}   m_s {row['specular_albedo']:.2f}"
            f"   s {row['exponent']:.3g}   m_s·c(s) {row['lobe_peak']:.3g}"
        )
    if row["mask"] == OWN and row["iou"] is not None:
        text += f"   IoU {row['iou']:.0%}"
    named = f"{row['mask']}: " if row["mask"] != OWN or row["iou"] is not None else ""
    pen.text((left + 4, top), named + text, fill=theme.ink, font=_font(14))


def _page(heading: str, cards: Sequence[Image.Image], across: int, theme: Theme) -> Image.Image:
    """Put cards into columns, in reading order, below a heading."""
    margin, apart = 2 * _GAP, 4 * _GAP
    across = min(across, len(cards))
    lines = [cards[start : start + across] for start in range(0, len(cards), across)]
    heights = [max(card.height for card in line) for line in lines]
    width = max(sum(card.width + apart for card in line) - apart for line in lines)
    height = sum(heights) + len(lines) * margin + _LINE
    page = Image.new("RGB", (width + 2 * margin, height + 2 * margin), theme.paper)
    pen = ImageDraw.Draw(page)
    pen.text((margin, margin), _fitted(heading, width), fill=theme.ink, font=_font())
    top = 2 * margin + _LINE
    for line, tall in zip(lines, heights, strict=True):
        for column, card in enumerate(line):
            page.paste(card, (margin + column * (card.width + apart), top))
        top += tall + margin
    return page


def _fitted(text: str, width: int) -> str:
    """Return the text, shortened at its end to a width in pixels."""
    if _width(text) <= width:
        return text
    too_long = bisect.bisect(range(len(text)), width, key=lambda end: _width(f"{text[:end]}…"))
    return f"{text[: max(too_long - 1, 0)]}…"


def _width(text: str) -> int:
    return math.ceil(_font().getlength(text))


def _jpeg(page: Image.Image) -> bytes:
    content = io.BytesIO()
    page.save(content, "JPEG", quality=88, subsampling=0)
    return content.getvalue()


@functools.cache
def _font(size: int = 15) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size=size)
