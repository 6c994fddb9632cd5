"""Contact sheets: every photo with its answers, the glossiest first."""

import io

import numpy as np
import pytest
from PIL import Image

from lime_keras.eval.photos import measures, summary
from lime_keras.eval.photos.answers import GIVEN, OWN, Answers
from lime_keras.eval.photos.folder import Photo
from lime_keras.eval.report import contact_sheet
from lime_keras.eval.report.themes import DARK, LIGHT

TITLES = ("photo and mask", "specular shading S", "mirror image M", "in a studio")


def made(count, models=("one",), unanswered=()):
    """Photos with answers; the higher k, the glossier photo k; its pictures have level k."""
    exponent = np.where(np.isin(np.arange(count), unanswered), np.nan, 10.0 + np.arange(count))
    known = np.isfinite(exponent)[:, None]
    columns = {
        "mask_given": np.zeros(count, bool),
        "found": np.isfinite(exponent),
        "coverage": np.full(count, 0.3),
        "iou": np.full(count, 0.5),
        "diffuse_albedo": np.where(known, [[0.5, 0.0, 0.0]], np.nan),
        "specular_albedo": np.where(np.isfinite(exponent), 0.1, np.nan),
        "exponent": exponent,
        "log_exponent": np.log10(exponent),
        "lobe_peak": measures.lobe_peak(0.1, exponent),
        "object_colour": np.tile([0.0, 0.5, 0.0], (count, 1)),
        "frame_colour": np.full((count, 3), 0.2),
    }
    given = columns | {"mask_given": np.ones(count, bool), "iou": np.full(count, np.nan)}
    pictures = {
        (model, k): {
            title: np.full((256, 256, 3), k, np.uint8)
            for title in TITLES
            if k not in unanswered or title != "in a studio"
        }
        for model in models
        for k in range(count)
    }
    kinds = {
        (model, mask): (columns, given)[mask == GIVEN] for model in models for mask in (OWN, GIVEN)
    }
    answers = Answers(kinds, pictures)
    finish = ("glossy", "matte", None)
    photos = [Photo(f"{k}.png", None, None, finish[k % 3], note="x" * 200) for k in range(count)]
    return photos, answers, summary.summarise(photos, answers)


def pixels(draw, theme=LIGHT):
    image = Image.open(io.BytesIO(draw(theme)))
    assert image.format == "JPEG"
    return np.asarray(image.convert("RGB"), int)


def test_the_glossiest_photo_is_the_first():
    [draw] = contact_sheet.sheets(*made(4))
    page = pixels(draw)
    # Constant tiles of level k, in reading order, two across.
    tile = contact_sheet._TILE
    rows = [r for r in range(page.shape[0]) if np.all(page[r, 20 : 20 + tile // 2] < 12)]
    first, last = rows[tile // 2], rows[-tile // 2]
    right = page.shape[1] // 2 + 60
    found = [page[row, column].mean() for row in (first, last) for column in (60, right)]
    assert found == pytest.approx([3, 2, 1, 0], abs=0.7)


def test_many_photos_take_several_sheets():
    count = contact_sheet.PER_SHEET + 1
    whole, rest = contact_sheet.sheets(*made(count))
    assert pixels(whole).shape[0] > 8 * pixels(rest).shape[0]


def test_models_stand_side_by_side():
    [one], [two] = (contact_sheet.sheets(*made(2, models)) for models in (("a",), ("a", "b")))
    assert pixels(two).shape[0] > 1.5 * pixels(one).shape[0]
    assert pixels(two).shape[1] == pytest.approx(pixels(one).shape[1], abs=40)


def test_a_sheet_takes_its_pages_colours():
    [draw] = contact_sheet.sheets(*made(1))
    for theme in (LIGHT, DARK):
        corner = pixels(draw, theme)[2, 2]
        assert corner.tolist() == pytest.approx(
            Image.new("RGB", (1, 1), theme.paper).getpixel((0, 0)), abs=2
        )


def test_swatches_show_the_colours_of_m_d_and_of_the_pixels():
    [draw] = contact_sheet.sheets(*made(1))
    page = pixels(draw)
    red = (page[..., 0] > 240) & (page[..., 1] < 20) & (page[..., 2] < 20)
    green = (page[..., 1] > 240) & (page[..., 0] < 20) & (page[..., 2] < 20)
    assert 300 < red.sum() < 700 and 300 < green.sum() < 700, "a pair for each of the two masks"
    assert np.argwhere(red)[:, 1].max() < np.argwhere(green)[:, 1].min()


def test_a_long_text_is_shortened_to_its_room():
    for width in (30, 100, 1000):
        text = contact_sheet._fitted("W" * 200, width)
        assert text.endswith("…") and width - 20 < contact_sheet._font().getlength(text) <= width
    assert contact_sheet._fitted("short", 1000) == "short"


def test_a_photo_without_an_answer_has_its_place():
    [draw] = contact_sheet.sheets(*made(2, unanswered=(1,)))
    assert pixels(draw).shape[1] == pixels(contact_sheet.sheets(*made(2))[0]).shape[1]
    [draw] = contact_sheet.sheets(*made(1, unanswered=(0,)))
    red = pixels(draw)[..., 0] - pixels(draw)[..., 1]
    assert red.max() < 100, "no swatch of an m_d"
