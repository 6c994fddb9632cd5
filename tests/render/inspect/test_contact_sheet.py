"""The contact sheet of a corpus."""

import numpy as np
import pytest
import sphere_corpus
from PIL import Image

from lime_keras.data import records
from lime_keras.optics import colour
from lime_keras.render.inspect import contact_sheet

COUNT = 7


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return sphere_corpus.write_split(
        tmp_path_factory.mktemp("corpus"), "test", [range(4), range(4, COUNT)]
    )


def parsed(index, size=sphere_corpus.SIZE):
    serialized = records.encode(sphere_corpus.example(index, size=size))
    return {name: value.numpy() for name, value in records.parse(serialized).items()}


def test_the_sheet_lies_beside_the_shards(corpus):
    told = []
    path = contact_sheet.write(corpus, "test", lambda *progress: told.append(progress))
    assert path == corpus / "test" / "preview.png"
    with Image.open(path) as page:
        assert page.width > 1200 and page.height > COUNT * contact_sheet._THUMB
    assert told == [(done, COUNT) for done in range(1, COUNT + 1)]
    assert not list((corpus / "test").glob("partial-*"))


def test_the_sheet_tells_every_parameter_of_an_example():
    record = parsed(3)
    index, bin_and_exponent, m_d, grey, coverage, shape, light = contact_sheet.words(record)
    assert index == "3" and bin_and_exponent.endswith(f"s = {record['shininess']:.3g}")
    assert m_d == "m_d = " + "  ".join(f"{value:.2f}" for value in record["diffuse_albedo"])
    assert grey == f"m_s = {record['specular_albedo']:.2f}   m_a = 0.020"
    assert coverage == f"coverage {record['mask'].mean():.0%}"
    assert (shape, light) == ("sphere", "lamp")


def test_the_sheet_shows_the_layers():
    """Thumbnails of the record's size are the record's own pixels."""
    example = parsed(0, size=128)
    sheet = np.asarray(contact_sheet.draw([example], 1, "corpus/test")) / 255
    left, top, step = contact_sheet._MARGIN, contact_sheet._HEAD, 128 + contact_sheet._GAP
    thumbs = [sheet[top : top + 128, left + k * step : left + k * step + 128] for k in range(6)]
    shading = example["diffuse_shading"]
    np.testing.assert_allclose(thumbs[0], example["image"], atol=1 / 255)
    np.testing.assert_allclose(thumbs[1], example["mask"].repeat(3, -1), atol=1 / 255)
    curve = colour.linear_to_srgb(shading / (1 + shading)).repeat(3, -1)
    np.testing.assert_allclose(thumbs[2], curve, atol=1 / 255)
    inside = example["mask"][..., 0] > 0
    np.testing.assert_allclose(thumbs[5][inside], (example["normal"][inside] + 1) / 2, atol=1 / 255)
    assert np.all(thumbs[5][~inside] == 1)
    patch = sheet[top + 10, -contact_sheet._MARGIN - 10]
    albedo = colour.linear_to_srgb(example["diffuse_albedo"])
    np.testing.assert_allclose(patch, albedo, atol=1 / 255)


def test_long_names_are_shortened_in_the_middle():
    name = "a_very_long_name_of_an_environment_map_4k.hdr"
    short = contact_sheet._shortened(name)
    assert len(short) == contact_sheet._LONGEST_NAME
    assert short.startswith("a_very_long") and short.endswith("_map_4k.hdr")
    assert contact_sheet._shortened("lamp.hdr") == "lamp.hdr"


def test_the_examples_shown_are_spread_over_the_split(corpus, monkeypatch):
    drawn, draw = [], contact_sheet.draw
    monkeypatch.setattr(contact_sheet, "_SHOWN", 3)
    monkeypatch.setattr(contact_sheet, "draw", lambda *a: drawn.extend(a[0]) or draw(*a))
    contact_sheet.write(corpus, "test", lambda *_: None)
    assert [int(example["index"]) for example in drawn] == [0, 3, 6]


def test_an_incomplete_split_is_told(tmp_path):
    with pytest.raises(FileNotFoundError, match="lime-render"):
        contact_sheet.write(tmp_path, "train", lambda *_: None)
