"""Answers with own and with given masks, of an engine whose answers are known."""

import numpy as np
import photo_answers
import pytest

from lime_keras.eval.photos import folder, measures
from lime_keras.eval.photos.answers import GIVEN, OWN, answer
from lime_keras.optics import shininess
from lime_keras.optics.colour import srgb_to_linear

LEVELS = [102, 153, 51]
"""Levels of the object; green is in bin 4 of 8."""


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """Return a function that answers the photos in `tmp_path/photos` with one model, `live`."""

    def ask(**settings):
        photo_answers.install(monkeypatch, {"live": photo_answers.Engine(**settings)})
        photos = folder.read(tmp_path / "photos", tmp_path / "out")
        return answer(photos, {"live": tmp_path / "live"})

    return ask


def test_an_answer_has_the_numbers_of_the_model_and_of_the_photo(asked, tmp_path):
    photo_answers.write(tmp_path / "photos" / "a.png", LEVELS)
    found = asked(specular=0.3)
    assert list(found) == [("live", OWN)], "no photo has a mask"
    of = found["live", OWN]
    s = 10 ** shininess.LOG_MEANS[4]
    assert of["exponent"] == pytest.approx(s) and of["log_exponent"] == pytest.approx(np.log10(s))
    assert of["specular_albedo"] == pytest.approx(0.3) and of["found"].all()
    assert of["lobe_peak"] == pytest.approx(float(measures.lobe_peak(0.3, s)))
    assert of["coverage"] == pytest.approx(photo_answers.disc().mean(), abs=0.02)
    assert np.isnan(of["iou"]).all()
    colour = of["object_colour"][0]
    assert measures.angle(colour, srgb_to_linear(np.array(LEVELS) / 255)) < 1
    # The whole photo is the same colour, darker.
    assert measures.angle(of["frame_colour"][0], colour) < 1
    assert of["frame_colour"][0].sum() < 0.5 * colour.sum()


def test_a_given_mask_is_used_where_there_is_one(asked, tmp_path):
    half = photo_answers.disc() & (np.arange(48) < 24)
    photo_answers.write(tmp_path / "photos" / "a.png", LEVELS, mask=half)
    photo_answers.write(tmp_path / "photos" / "b.png", LEVELS)
    found = asked()
    own, given = found["live", OWN], found["live", GIVEN]
    assert given["mask_given"].tolist() == [True, False] and not own["mask_given"].any()
    assert own["iou"][0] == pytest.approx(0.5, abs=0.06) and np.isnan(own["iou"][1])
    assert np.isnan(given["iou"]).all()
    assert given["coverage"][0] == pytest.approx(half.mean()), "the given mask itself"
    assert own["coverage"][0] == pytest.approx(own["coverage"][1])
    for name in set(own) - {"mask_given"}:
        assert np.array_equal(own[name][1], given[name][1], equal_nan=True), name
    # Both colours are of the object as it is best known: inside the given mask.
    assert np.array_equal(own["object_colour"], given["object_colour"])


def test_transparency_is_a_given_mask_unless_there_is_a_file(asked, tmp_path):
    half = photo_answers.disc() & (np.arange(48) < 24)
    photo_answers.write(tmp_path / "photos" / "a.png", LEVELS, alpha=half)
    photo_answers.write(
        tmp_path / "photos" / "b.png", LEVELS, alpha=half, mask=photo_answers.disc(6)
    )
    given = asked()["live", GIVEN]
    assert given["mask_given"].all()
    expected = [half.mean(), photo_answers.disc(6).mean()]
    assert given["coverage"].tolist() == pytest.approx(expected)


def test_photos_without_an_object_have_no_answer(asked, tmp_path):
    photo_answers.write(tmp_path / "photos" / "black.png", [0, 0, 0])
    photo_answers.write(tmp_path / "photos" / "red.png", [200, 0, 0])
    photo_answers.write(tmp_path / "photos" / "white.png", [200, 200, 200])
    found = asked()
    of = found["live", OWN]
    assert of["found"].tolist() == [False, False, True]
    for name in ("specular_albedo", "exponent", "log_exponent", "lobe_peak", "diffuse_albedo"):
        assert np.isnan(of[name][:2]).all() and np.isfinite(of[name][2]).all(), name
    assert of["coverage"][:2].tolist() == [0, 0]


def test_masks_that_do_not_fit_are_told_by_name(asked, tmp_path):
    photo_answers.write(tmp_path / "photos" / "a.png", LEVELS, mask=np.ones((48, 40)))
    with pytest.raises(ValueError, match=r"a_mask\.png has 40×48 pixels and its photo 48×48"):
        asked()
    photo_answers.write(tmp_path / "photos" / "a.png", LEVELS, mask=np.zeros((48, 48)))
    with pytest.raises(ValueError, match=r"a_mask\.png is black"):
        asked()
    (tmp_path / "photos" / "a.png").write_bytes(b"not a picture")
    with pytest.raises(ValueError, match=r"a\.png cannot be read"):
        asked()
