"""Table 1 of several runs: order, paired differences, the paper's rows."""

import dataclasses
import json

import numpy as np
import pytest
from evaluations import LIME

from lime_keras.eval.accuracy import comparison, measures
from lime_keras.eval.accuracy.comparison import System
from lime_keras.networks import PRESETS

COUNT = 400
UNKNOWN = System("of an unknown recipe")


def _rows(shift=0.0):
    """Columns that share their noise between runs; log errors and albedo errors are shifted."""
    rng = np.random.default_rng(5)
    noise = rng.uniform(0.2, 3.0, COUNT)
    return {
        "seed": np.zeros(COUNT, int),
        "index": np.arange(COUNT),
        "bin": np.zeros(COUNT, int),
        "bin_distance": rng.integers(0, 4, COUNT),
        "log_error": noise + shift,
        "diffuse_absolute": noise / 5 - shift / 5,
        "relit": 20 + noise + shift,
    }


def _compared():
    rows = {"z": _rows(0.05), "first": _rows(), "sphere": _rows(0.0)}
    rows_of = {"z": "without MirrorNet", "first": comparison.FULL, "sphere": "reflectance map"}
    return comparison.compare(rows, {name: System(row, row) for name, row in rows_of.items()})


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


def test_the_table_has_all_25_cells_of_the_papers():
    text = comparison.markdown(_compared()).partition("What the paper concludes")[0]
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert len(lines) == 2 + 3 + 5
    cells = {
        "full approach": ("45.07 %", "40.12 %", "0.3073", "0.0674"),
        "without perceptual loss": ("45.15 %", "40.96 %", "0.3038", "0.1406"),
        "without MirrorNet": ("36.29 %", "40.28 %", "0.3913", "0.0759"),
        "exponent regression": ("44.09 %", "41.28 %", "0.2974", "0.0683"),
        "reflectance map": ("13.57 %", "25.29 %", "0.7243", "0.0408"),
    }
    specular = (0.2158, 0.2368, 0.2449, 0.2723, 0.1758)
    assert [row["specular_albedo_mae"] for row in comparison.PAPER.values()] == list(specular)
    below = {"full approach": 3, "without MirrorNet": 5, "reflectance map": 7}
    for row, found in cells.items():
        [line] = [
            line
            for line in ([lines[below[row]]] if row in below else lines[8:])
            if row in below or row in line
        ]
        assert all(cell in line for cell in found), line
    assert len({len(line) for line in lines}) == 1
    assert "Mirror" not in lines[0] and "mask IoU" not in lines[0]


def test_intervals_are_those_of_each_runs_own_metrics():
    own = measures.ends(measures.resampled(_rows(0.05)))
    for name, interval in _compared()["runs"]["z"]["interval"].items():
        assert interval == pytest.approx(own[name]), name


@pytest.mark.parametrize("name, value", [("index", np.arange(COUNT) + COUNT), ("seed", 1)])
def test_runs_of_other_images_are_refused(name, value):
    rows = {"a": _rows(), "b": _rows() | {name: np.full(COUNT, value)}}
    with pytest.raises(ValueError, match="not measured on the same images"):
        comparison.compare(rows, dict.fromkeys(rows, UNKNOWN))


def test_another_system_stands_below_with_what_it_answers():
    other = _rows(0.05) | {"answered": np.arange(COUNT) > 2}
    del other["bin_distance"], other["relit"]
    title = comparison.other_system(other)
    assert title.name == "another system, 397 of 400 images answered"
    assert comparison.other_system({"answered": np.ones(3, bool)}) == System("another system")
    rows = {"net": other, "run": _rows()}
    systems = {"net": title, "run": System("full", comparison.FULL)}
    compared = comparison.compare(rows, systems)
    assert list(compared["runs"]) == ["run", "net"] and compared["reference"] == "run"
    assert set(compared["runs"]["net"]["value"]) == {"log_exponent_mae", "diffuse_albedo_mae"}
    [line] = [one for one in comparison.markdown(compared).splitlines() if "net: " in one]
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[0] == f"net: {title.name}" and cells[1:3] == ["–", "–"]
    assert cells[3].endswith(" −") and cells[4].endswith(" +")


def _record(run, architecture=LIME, **changes):
    """Write the record of a run by the paper's recipe, but for some fields."""
    schedule = {
        "optimizer": "adam",
        "losses": "printed",
        "batch_size": 32,
        "single_learning_rate": 1e-4,
        "joint_learning_rate": 1e-4,
        **dict.fromkeys(("cosine", "camera", "flips", "repaints", "paints", "found_masks"), False),
        **dict.fromkeys(("steps", "rate", "average")),
    }
    config = {"lobe": "printed", "precision": "float32", "compositing": True, "steps_scale": 1.0}
    changed = schedule | {name: v for name, v in changes.items() if name in schedule}
    others = {name: v for name, v in changes.items() if name not in schedule}
    record = {"config": config | others | {"schedule": changed}}
    (run / "config.json").write_text(json.dumps(record), encoding="utf-8")


PAPERS = PRESETS["paper"]


@pytest.mark.parametrize(
    "fields, compositing, row",
    [
        ({}, True, "full approach"),
        ({}, False, "without perceptual loss"),
        ({"mirror": False}, True, "without MirrorNet"),
        ({"exponent": "regression"}, True, "exponent regression"),
        ({"system": "reflectance-map"}, True, "reflectance map"),
    ],
)
def test_a_run_by_the_papers_recipe_is_a_row_of_its_table(fields, compositing, row, tmp_path):
    _record(tmp_path, compositing=compositing)
    found = comparison.system(dataclasses.replace(PAPERS, **fields), tmp_path)
    assert found == System(row, row)


def test_a_smaller_run_says_how_much_smaller(tmp_path):
    _record(tmp_path, steps_scale=0.1)
    small = dataclasses.replace(PAPERS, size=64, unet_width=16)
    found = comparison.system(small, tmp_path)
    name = "full approach at 64 px, 16 wide, 0.1 of the batches"
    assert found == System(name, comparison.FULL)
    _record(tmp_path, steps=24)
    found = comparison.system(PAPERS, tmp_path)
    assert found == System("full approach at 24 batches a stage", comparison.FULL)


@pytest.mark.parametrize(
    "changes",
    [
        {"rate": 1e-2},
        {"average": 0.999},
        {"plain_scenes": False},
        {"camera": True},
        {"flips": True},
        {"repaints": True},
        {"paints": True},
        {"found_masks": True},
        {"cosine": True},
        {"optimizer": "muon"},
        {"losses": "robust"},
        {"batch_size": 16},
        {"single_learning_rate": 1e-3},
        {"joint_learning_rate": 2e-4},
        {"lobe": "furnace"},
        {"precision": "bfloat16"},
        {"begun_from": "a hash"},
        {"materials": ["natural"]},
        {"frozen": ["segmentation"]},
        {"cutouts": "a hash"},
    ],
    ids=str,
)
def test_another_recipe_is_never_the_full_approach(changes, tmp_path):
    _record(tmp_path, **changes)
    assert comparison.system(PAPERS, tmp_path) == System("another recipe")


@pytest.mark.parametrize(
    "fields, name",
    [
        ({"dichromatic": True}, "another recipe, with the split of colours"),
        ({"hue": True, "mirror": False}, "another recipe, with the hue of pixels, without MirrorN"),
        ({"mask_contrast": True}, "another recipe"),
        ({"linear": False}, "another recipe"),
        ({"pretrained": True}, "another recipe"),
        ({"mirror": False, "exponent": "regression"}, "another recipe, without MirrorNet, expon"),
    ],
)
def test_other_networks_are_named_after_what_they_are(fields, name, tmp_path):
    _record(tmp_path)
    found = comparison.system(dataclasses.replace(PAPERS, **fields), tmp_path)
    assert found.name.startswith(name) and found.row is None


def test_a_model_without_a_record_is_of_an_unknown_recipe(tmp_path):
    assert comparison.system(PAPERS, tmp_path) == System("of an unknown recipe")
