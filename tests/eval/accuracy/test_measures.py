"""Aggregates against numbers worked out by hand."""

import dataclasses
import json
import math

import numpy as np
import pytest
from evaluations import LIME, four

from lime_keras.eval.accuracy import measures
from lime_keras.eval.accuracy.evaluate import Evaluation
from lime_keras.optics import material_law, shininess


def test_the_means_are_those_of_hand_arithmetic():
    summary = measures.summarise(four())
    expected = {
        "mask_iou": 0.75,
        "mask_iou_pooled": 70 / 80,
        "exponent_exact": 0.25,
        "exponent_adjacent": 0.5,
        "exponent_within_one": 0.75,
        "log_exponent_mae": 0.25,
        "log_exponent_rmse": 0.3,
        "log_exponent_mae_winning": 0.3,
        "log_exponent_bias": 0.1,
        "ggx_alpha_mae": 0.1,
        "diffuse_albedo_mae": 0.1,
        "diffuse_albedo_rmse": 0.1,
        "specular_albedo_mae": 0.1,
        "specular_albedo_rmse": 0.2,
        "specular_shading_relative": 0.5,
        "specular_shading_flip": 0.25,
        "mirror_relative": 1.5,
        "mirror_flip": 0.3,
        "relighting_psnr": 25.0,
        "relighting_psnr_unseen": 15.0,
        # All were called 60 % probable, and a quarter is right.
        "calibration_error": 0.35,
    }
    assert {name: summary[name] for name in measures.MEASURES} == pytest.approx(expected)
    assert summary["count"] == 4 and summary["counted"] == {}


def test_an_image_with_a_black_layer_does_not_count_and_is_counted():
    lit = np.array([1.0, 1.0, 0.0, 1.0])
    summary = measures.summarise(four(specular_shading_lit=lit))
    assert summary["specular_shading_relative"] == pytest.approx(2 / 3)
    assert summary["counted"] == {"specular_shading_relative": 3}
    low, high = summary["interval"]["specular_shading_relative"]
    assert 0.5 <= low < 2 / 3 < high <= 1.0
    of_none = measures.summarise(four(specular_shading_lit=np.zeros(4)))
    assert of_none["specular_shading_relative"] == 0 and of_none["counted"] != {}


def test_exact_and_adjacent_add_up_to_within_one():
    summary = measures.summarise(four())
    for part in (summary, summary["true_mask"], summary["paper"]):
        total = part["exponent_exact"] + part["exponent_adjacent"]
        assert total == pytest.approx(part["exponent_within_one"])


def test_errors_with_the_true_mask_are_summarised_from_their_own_columns():
    found = measures.summarise(four())["true_mask"]
    assert found["log_exponent_mae"] == pytest.approx(0.125)
    assert found["specular_albedo_rmse"] == pytest.approx(math.sqrt(0.02))
    assert "mask_iou" not in found


def test_chance_is_the_best_answer_that_ignores_the_image():
    evaluation = four()
    chance = measures.summarise(evaluation)["chance"]
    assert chance == measures.constant_answers(evaluation.rows)
    assert chance["specular_shading_relative"] == chance["mirror_relative"] == 1.0  # black layers
    # What the middle of all ranges does on these very examples.
    assert (chance["relighting_psnr"], chance["relighting_psnr_unseen"]) == (11.0, 9.0)


@pytest.mark.parametrize("law, specular", [("uniform", 0.25), ("natural", 0.08)])
def test_chance_follows_from_the_law_of_the_materials(law, specular):
    """Most natural materials have an m_s near 0.04, so knowing nothing errs little there."""
    rng = np.random.default_rng(0)
    drawn = [material_law.sample_material(rng, law).specular_albedo for _ in range(4000)]
    rows = {name: np.repeat(values[:1], 4000, axis=0) for name, values in four().rows.items()}
    found = measures.constant_answers(rows | {"specular_albedo": np.array(drawn)})
    assert found["specular_albedo_mae"] == pytest.approx(specular, rel=0.1)


def test_the_floor_is_what_a_perfect_classifier_errs():
    floor = measures.summarise(four())["floor"]
    assert floor["log_exponent_mae_winning"] == shininess.QUANTISATION_FLOOR


def test_constant_answers_beat_every_other_constant():
    rows = four().rows
    constant = measures.constant_answers(rows)
    assert constant["exponent_exact"] == 0.5
    # Bin 1 has two examples beside it, in bin 0.
    assert constant["exponent_adjacent"] == 0.5
    assert constant["exponent_within_one"] == 0.5
    assert constant["mask_iou"] == pytest.approx(0.2)
    assert constant["diffuse_albedo_rmse"] == pytest.approx(math.sqrt(0.25 / 3))
    for guess in np.linspace(0, 3, 31):
        error = np.mean(np.abs(rows["log_exponent"] - guess))
        assert constant["log_exponent_mae"] <= error + 1e-12
        alpha = np.minimum((2 / (10 ** rows["log_exponent"] + 2)) ** 0.625, 0.6)
        error = np.mean(np.abs(alpha - 0.6 * guess / 3))
        assert constant["ggx_alpha_mae"] <= error + 1e-12


def test_the_interval_is_that_of_the_normal_limit():
    rng = np.random.default_rng(1)
    error = rng.exponential(size=4000)
    names = ("exact", "adjacent", "within_one", *four().rows)
    columns = {name: np.ones(4000) for name in names} | {"log_error": error}
    low, high = measures.ends(measures.resampled(columns))["log_exponent_mae"]
    half = 1.96 * np.std(error) / math.sqrt(4000)
    assert low == pytest.approx(np.mean(error) - half, abs=half / 5)
    assert high == pytest.approx(np.mean(error) + half, abs=half / 5)


def test_intervals_hold_the_mean_and_repeat():
    first, again = measures.summarise(four()), measures.summarise(four())
    assert first == again
    for name, (low, high) in first["interval"].items():
        assert low - 1e-9 <= first[name] <= high + 1e-9


def test_one_example_has_an_interval_of_no_width():
    rows = {name: column[:1] for name, column in four().rows.items()}
    summary = measures.summarise(four(**rows))
    assert summary["interval"]["mask_iou"] == [1.0, 1.0]


def test_extremes_stay_finite_and_become_strict_json():
    huge = np.array([0.0, 1e20, 4e21, 0.0])
    none = np.zeros(4)
    changes = {"mirror_relative": huge, "union": none, "intersection": none, "coverage": none}
    summary = measures.summarise(four(**changes))
    assert summary["mask_iou_pooled"] == 1.0
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary


def test_paper_row_is_the_full_approach():
    paper = measures.summarise(four())["paper"]
    assert paper == {
        "mask_iou": 0.9983,
        "exponent_exact": 0.4507,
        "exponent_adjacent": 0.4012,
        "exponent_within_one": 0.8519,
        "log_exponent_mae": 0.3073,
        "log_exponent_mae_winning": 0.3073,
        "diffuse_albedo_mae": 0.0674,
        "specular_albedo_mae": 0.2158,
    }


@pytest.mark.parametrize(
    "columns, lacking",
    [
        (["mirror_relative"], {"mirror_relative"}),
        (["log_error_winning"], {"log_exponent_mae_winning"}),
        (
            ["specular_shading_relative", "mirror_relative"],
            {"specular_shading_relative", "mirror_relative"},
        ),
        (["bin_probabilities"], {"calibration_error"}),
        (["specular_shading_flip", "mirror_flip"], {"specular_shading_flip", "mirror_flip"}),
    ],
)
def test_what_a_system_does_not_have_is_left_out_everywhere(columns, lacking):
    whole = four()
    rows, true_mask = (
        {name: values for name, values in held.items() if name not in columns}
        for held in (whole.rows, whole.true_mask)
    )
    summary = measures.summarise(Evaluation(rows, true_mask, LIME))
    complete = measures.summarise(whole)
    assert set(complete) - set(summary) == lacking
    for kind in ("interval", "true_mask", "paper", "chance", "floor"):
        assert set(summary[kind]) == set(complete[kind]) - lacking, kind
    for name in set(summary) - {"interval", "true_mask", "paper", "chance", "floor"}:
        assert summary[name] == complete[name]


def test_an_exported_model_is_not_measured_with_the_true_mask():
    whole = four()
    summary = measures.summarise(dataclasses.replace(whole, true_mask={}))
    assert summary["true_mask"] == {}
    assert summary["interval"] == measures.summarise(whole)["interval"]


def test_numbers_are_printed_by_their_unit():
    assert measures.PER_CENT.number(None) == "–"
    assert measures.PER_CENT.number(np.float32(0.5)) == "50.00 %"
    assert measures.DECIBEL.number(31.416) == "31.42 dB"
    assert measures.PLAIN.number(0.25) == "0.2500"
    assert measures.PER_CENT.with_interval(0.4507, [0.44, 0.46]) == "45.07 ± 1.00 %"
    assert measures.PLAIN.with_interval(0.0674, [0.06, 0.08]) == "0.0674 ± 0.0100"


def test_no_two_measures_have_one_title():
    for titles in ("title", "short"):
        assert len({getattr(one, titles) for one in measures.MEASURES.values()}) == len(
            measures.MEASURES
        )


def test_the_system_is_named():
    whole = four()
    assert measures.summarise(whole)["system"] == "LIME"
    alone = dataclasses.replace(whole, architecture=dataclasses.replace(LIME, mirror=False))
    assert measures.summarise(alone)["system"] == "LIME without MirrorNet"
