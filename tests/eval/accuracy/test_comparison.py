"""Table 1 of several runs: order, paired differences, the paper's rows."""

import dataclasses
import json

import numpy as np
import pytest
from evaluations import LIME

from lime_keras.eval.accuracy import comparison, measures

COUNT = 400


def _rows(shift=0.0, seed=0):
    """Columns that share their noise between runs; log errors and albedo errors are shifted."""
    rng = np.random.default_rng(5)
    noise = rng.uniform(0.2, 3.0, COUNT)
    return {
        "seed": np.full(COUNT, seed),
        "index": np.arange(COUNT),
        "bin": np.zeros(COUNT, int),
        "bin_distance": rng.integers(0, 4, COUNT),
        "log_error": noise + shift,
        "diffuse_absolute": noise / 5 - shift / 5,
        "relit": 20 + noise + shift,
    }


def _compared():
    rows = {"z": _rows(0.05), "first": _rows(), "sphere": _rows(0.0)}
    systems = {"z": "without MirrorNet", "first": comparison.FULL, "sphere": "reflectance map"}
    return comparison.compare(rows, systems)


def test_runs_stand_in_the_papers_order_and_the_full_approach_is_the_reference():
    compared = _compared()
    assert list(compared["runs"]) == ["first", "z", "sphere"]
    assert compared["reference"] == "first" and "difference" not in compared["runs"]["first"]
    assert json.loads(json.dumps(compared, allow_nan=False)) == compared


def test_a_difference_smaller_than_either_interval_is_seen_on_the_same_images():
    run = _compared()["runs"]["z"]
    low, high = run["interval"]["log_exponent_mae"]
    first = _compared()["runs"]["first"]["value"]["log_exponent_mae"]
    assert low < first < high
    assert run["difference"]["log_exponent_mae"] == pytest.approx([0.05, 0.05])
    assert comparison.verdict(run, "log_exponent_mae") == "−"
    assert comparison.verdict(run, "diffuse_albedo_mae") == "+"
    assert comparison.verdict(run, "relighting_psnr") == "+"


def test_what_does_not_differ_is_not_marked():
    runs = _compared()["runs"]
    for name in runs["sphere"]["value"]:
        assert comparison.verdict(runs["sphere"], name) == ""
    # A neighbouring bin is half right, neither better nor worse.
    shifted = {"difference": {"exponent_adjacent": [0.1, 0.2]}}
    assert comparison.verdict(shifted, "exponent_adjacent") == ""


def test_the_table_has_the_papers_rows_that_are_known():
    text = comparison.markdown(_compared())
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert len(lines) == 2 + 3 + 2
    assert "45.07 %" in lines[3] and "0.3073" in lines[3]
    assert "13.57 %" in lines[6] and "0.7243" in lines[6]
    assert len({len(line) for line in lines}) == 1
    assert "Mirror" not in lines[0] and "mask IoU" not in lines[0]


def test_intervals_are_those_of_each_runs_own_metrics():
    own = measures.intervals(_rows(0.05))
    for name, interval in _compared()["runs"]["z"]["interval"].items():
        assert interval == pytest.approx(own[name]), name


def test_other_images_of_the_same_corpus_are_refused():
    other = _rows() | {"index": np.arange(COUNT) + COUNT}
    with pytest.raises(ValueError, match="not measured on the same images"):
        comparison.compare({"a": _rows(), "b": other}, dict.fromkeys("ab", comparison.FULL))


def test_runs_of_other_images_are_refused():
    rows = {"a": _rows(), "b": _rows(seed=1)}
    with pytest.raises(ValueError, match="same images"):
        comparison.compare(rows, dict.fromkeys(rows, comparison.FULL))


def test_another_system_stands_below_with_what_it_answers():
    other = _rows(0.05) | {"answered": np.arange(COUNT) > 2}
    del other["bin_distance"], other["relit"]
    title = comparison.other_system(other)
    assert title == "another system, 397 of 400 images answered"
    assert comparison.other_system({"answered": np.ones(3, bool)}) == "another system"
    rows, systems = {"net": other, "run": _rows()}, {"net": title, "run": comparison.FULL}
    compared = comparison.compare(rows, systems)
    assert list(compared["runs"]) == ["run", "net"] and compared["reference"] == "run"
    assert set(compared["runs"]["net"]["value"]) == {"log_exponent_mae", "diffuse_albedo_mae"}
    line = comparison.markdown(compared).splitlines()[-3]
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[0] == f"net: {title}" and cells[1:3] == ["–", "–"]
    assert cells[3].endswith(" −") and cells[4].endswith(" +")


@pytest.mark.parametrize(
    "fields, compositing, name",
    [
        ({}, True, "full approach"),
        ({}, False, "without perceptual loss"),
        ({"mirror": False}, True, "without MirrorNet"),
        ({"exponent": "regression"}, True, "exponent regression"),
        ({"system": "reflectance-map"}, True, "reflectance map"),
        ({"dichromatic": True}, True, "with the split of colours"),
        ({"hue": True, "mirror": False}, True, "with the hue of pixels, without MirrorNet"),
        ({"mirror": False}, False, "without perceptual loss, without MirrorNet"),
    ],
)
def test_a_run_is_told_by_its_record(fields, compositing, name, tmp_path):
    record = {"config": {"compositing": compositing}}
    (tmp_path / "config.json").write_text(json.dumps(record), encoding="utf-8")
    assert comparison.system(dataclasses.replace(LIME, **fields), tmp_path) == name


def test_a_model_without_a_record_counts_as_trained_with_all_losses(tmp_path):
    assert comparison.system(LIME, tmp_path) == comparison.FULL
