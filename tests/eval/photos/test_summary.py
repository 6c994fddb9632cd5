"""The table of the measures, its marks, and the list of photos."""

import json

import numpy as np
import pytest

from lime_keras.eval.photos import measures, summary
from lime_keras.eval.photos.answers import GIVEN, OWN
from lime_keras.eval.photos.folder import Photo

NAN = np.nan


def photo(name, finish=None, dielectric=False, pair=None):
    return Photo(name, None, None, finish, dielectric, pair)


def columns(specular, exponent, **changes):
    """Columns of answers with these m_s and s, of grey-brown objects."""
    specular, exponent = np.array(specular, float), np.array(exponent, float)
    count = len(specular)
    brown = np.tile([0.4, 0.3, 0.2], (count, 1))
    return {
        "mask_given": np.zeros(count, bool),
        "found": np.isfinite(exponent),
        "coverage": np.full(count, 0.3),
        "iou": np.full(count, NAN),
        "diffuse_albedo": np.where(np.isfinite(exponent)[:, None], brown - 0.1, NAN),
        "specular_albedo": specular,
        "exponent": exponent,
        "log_exponent": np.log10(exponent),
        "lobe_peak": measures.lobe_peak(specular, exponent),
        "object_colour": brown,
        "frame_colour": brown + 0.2,
    } | changes


PHOTOS = [
    photo("cup.png", "glossy", True, "white"),
    photo("a/ball.png", "glossy", True),
    photo("cloth.png", "matte"),
    photo("plaster.png", "matte", True, "white"),
    photo("unknown.png"),
]
GOOD = columns([0.04, 0.03, 0.01, 0.05, 0.2], [300, 200, 3, 5, 40])
BAD = columns([0.5, 0.6, 0.7, 0.5, NAN], [2, 4, 300, 100, NAN])


def of(answers, model="good", mask=OWN, photos=PHOTOS):
    found = summary.summarise(photos, answers)
    [one] = [c for c in found["columns"] if (c["model"], c["mask"]) == (model, mask)]
    return found, {name: result["value"] for name, result in one["measures"].items()}


def test_the_measures_of_right_answers():
    found, value = of({("good", OWN): GOOD})
    assert value["gloss_order_exponent"] == value["gloss_order_peak"] == 1
    assert value["gloss_order_peak_in_pairs"] == 1
    ratio = (0.04 * 0.03 * 0.05) ** (1 / 3) / 0.04
    assert value["specular_ratio"] == pytest.approx(ratio)
    assert value["specular_within_2"] == 1 and value["unanswered"] == 0
    assert value["unexplained_angle"] == pytest.approx(0, abs=1e-6)
    expected = measures.angle(np.array([0.3, 0.2, 0.1]), np.array([0.4, 0.3, 0.2]))
    assert value["colour_angle"] == pytest.approx(expected)
    assert value["colour_angle_grey"] == pytest.approx(measures.angle(np.ones(3), [0.4, 0.3, 0.2]))
    assert value["colour_angle_others"] == pytest.approx(0, abs=1e-6)
    assert "iou" not in value
    counts = {name: found[name] for name in ("count", "glossy", "matte", "dielectrics", "masks")}
    assert counts == {"count": 5, "glossy": 2, "matte": 2, "dielectrics": 3, "masks": 0}


def test_no_answer_helps_no_model():
    _, value = of({("good", OWN): BAD})
    assert value["gloss_order_exponent"] == 0 and value["specular_within_2"] == 0
    assert value["unanswered"] == pytest.approx(0.2)
    nothing = columns([NAN] * 5, [NAN] * 5)
    _, value = of({("good", OWN): nothing})
    assert value["gloss_order_peak"] == 0.5 and value["specular_within_2"] == 0
    assert value["unanswered"] == 1
    assert not {"specular_ratio", "colour_angle"} & set(value)


def test_measures_without_labels_are_left_out():
    photos = [photo("a"), photo("b")]
    answers = {("good", OWN): columns([0.1, 0.2], [3, 30])}
    found, value = of(answers, photos=photos)
    assert set(value) == {
        name for name in summary.MEASURES if "angle" in name or name == "unanswered"
    }
    text = summary.markdown(photos, found)
    assert "AUC)" not in text and "dielectrics, over" not in text and "finish" not in text
    one_class = [photo("a", "matte"), photo("b", "matte")]
    assert "gloss_order_peak" not in of(answers, photos=one_class)[1]


def test_one_photo_has_no_intervals():
    photos = [photo("a", "glossy", dielectric=True)]
    found, value = of({("good", OWN): columns([0.1], [30])}, photos=photos)
    assert value["specular_ratio"] == pytest.approx(2.5)
    results = found["columns"][0]["measures"].values()
    assert all(result["interval"] is None for result in results)
    assert "[" not in summary.markdown(photos, found).split("In brackets")[0]


def test_what_is_better_than_the_first_model_is_marked():
    answers = {("bad", OWN): BAD, ("good", OWN): GOOD, ("same", OWN): BAD}
    found, _ = of(answers)
    text = summary.markdown(PHOTOS, found)
    rows = {line.split("|")[1].strip(): line for line in text.splitlines() if line[:1] == "|"}
    marked = [cell.strip() for cell in rows["Gloss order (AUC) by log10 s"].split("|")]
    assert marked[3:6] == ["0.00 [0.00, 0.00]", "1.00 [1.00, 1.00] +", "0.00 [0.00, 0.00]"]
    assert rows[f"{summary._DIELECTRIC}, within a factor of 2"].split("|")[4].endswith("+ ")
    # A ratio has no better direction.
    assert "+" not in rows[f"{summary._DIELECTRIC}, geometric mean"]
    swapped, _ = of({("good", OWN): GOOD, ("bad", OWN): BAD})
    assert "−" in summary.markdown(PHOTOS, swapped).split("Colour")[0]


def test_a_lower_error_is_better():
    measure = summary.MEASURES["colour_angle"]
    result = {"value": 2.0, "interval": (1.0, 3.0)}
    assert measure.text(result | {"difference": (-2.0, -1.0)}) == "2.0 ° [1.0, 3.0] +"
    assert measure.text(result | {"difference": (1.0, 2.0)}) == "2.0 ° [1.0, 3.0] −"
    assert measure.text(result | {"difference": (-1.0, 2.0)}) == "2.0 ° [1.0, 3.0]"
    assert measure.text(result | {"difference": None}) == "2.0 ° [1.0, 3.0]"
    assert measure.text(None) == "–"


def test_photos_are_sorted_by_gloss_with_those_unanswered_last():
    assert summary.by_gloss({("m", OWN): BAD}) == [2, 3, 1, 0, 4]
    assert summary.by_gloss({("m", OWN): columns([0, NAN], [5, NAN])}) == [0, 1]
    found, _ = of({("bad", OWN): BAD, ("good", OWN): GOOD})
    listed = summary.markdown(PHOTOS, found).split("| Photo ")[1].splitlines()[2:]
    names = [line.split("|")[1].strip() for line in listed]
    assert names == ["cloth.png", "plaster.png", "a/ball.png", "cup.png", "unknown.png"]
    cells = [cell.strip() for cell in listed[-1].split("|")[2:-1]]
    assert cells[:4] == ["–", "–", "–", "–"] and cells[5:] == ["40", "0.200"]


def test_the_json_holds_every_answer_and_no_nan():
    masked = GOOD | {"iou": np.array([0.5, NAN, NAN, NAN, NAN])}
    given = GOOD | {"mask_given": np.array([True, False, False, False, False])}
    found, value = of({("good", OWN): masked, ("good", GIVEN): given, ("bad", OWN): BAD})
    text = json.dumps(found, allow_nan=False)
    assert json.loads(text)["masks"] == 1 and value["iou"] == 0.5
    rows = found["photos"]
    of_cup = [(row["model"], row["mask"]) for row in rows if row["photo"] == "cup.png"]
    assert of_cup == [("good", OWN), ("good", GIVEN), ("bad", OWN)]
    assert len(rows) == 5 + 1 + 5, "a photo without a mask has no row of a given one"
    [none] = [row for row in rows if row["photo"] == "unknown.png" and row["model"] == "bad"]
    assert none["exponent"] is None and none["diffuse_albedo"] == [None] * 3
    assert none["specular_ratio"] is None and rows[0]["specular_ratio"] == pytest.approx(1)
    assert {tuple(row) for row in rows} == {tuple(rows[0])}, "each has the same columns"
