"""Scores, fronts and choices of rows made by hand."""

import math

import pytest

from lime_keras.eval.tradeoff import recommendation
from lime_keras.eval.tradeoff.recommendation import (
    best,
    for_devices,
    for_purposes,
    front,
    score,
    scored,
)

ERRORS = {
    "log_exponent_mae": 0.375,
    "diffuse_albedo_mae": 0.05,
    "specular_albedo_mae": 0.25,
    "specular_shading_relative": 0.5,
    "mirror_relative": 1.0,
    "mask_iou": 0.9,
}


def test_the_score_is_the_mean_of_error_over_chance():
    """Chance is 0.75 decades, 0.25 for both albedos and 1 for S and M."""
    assert scored([ERRORS]) == list(recommendation.SCORED)
    assert score(ERRORS, scored([ERRORS])) == pytest.approx((0.5 + 0.2 + 1 + 0.5 + 1) / 5)


def test_scores_compare_what_all_systems_answer():
    without = {name: value for name, value in ERRORS.items() if name != "mirror_relative"}
    shared = scored([ERRORS, without])
    assert "mirror_relative" not in shared and len(shared) == 4
    assert score(ERRORS, shared) == score(without, shared) == pytest.approx(2.2 / 4)
    with pytest.raises(ValueError, match="share none of log_exponent_mae"):
        score(ERRORS, scored([ERRORS, {}]))


FRONTS = {
    "none": ([], []),
    "single": ([(1, 1)], [True]),
    "all": ([(1, 3), (2, 2), (3, 1)], [True] * 3),
    "beaten": ([(1, 1), (2, 2)], [True, False]),
    "beaten in one, tied in the other": ([(1, 1), (1, 2), (2, 1)], [True, False, False]),
    "exact tie": ([(1, 1), (1, 1), (3, 3)], [True, True, False]),
    "inner corner": ([(1, 5), (3, 3), (5, 1), (4, 4)], [True, True, True, False]),
}


@pytest.mark.parametrize(("points", "expected"), FRONTS.values(), ids=FRONTS)
def test_the_front_by_hand(points, expected):
    assert front(points) == expected
    assert front(points[::-1]) == expected[::-1]


@pytest.mark.parametrize("number", [math.nan, math.inf])
@pytest.mark.parametrize("place", [0, 1])
def test_a_front_of_no_numbers_is_refused(number, place):
    point = [1.0, 1.0]
    point[place] = number
    with pytest.raises(ValueError, match="not finite"):
        front([(1.0, 1.0), tuple(point)])


def _row(latency, score, **changes):
    return {
        "model": "live",
        "runtime": "ONNX Runtime",
        "precision": "float32",
        "threads": 2,
        "latency_ms": latency,
        "gflop": 5.0,
        "score": score,
    } | changes


def _cost(row):
    return row["latency_ms"]


def test_the_best_is_the_least_score_within_the_budget():
    rows = [_row(10, 0.6), _row(20, 0.5), _row(40, 0.1)]
    assert best(rows, _cost, 33) == {"row": rows[1], "cost": 20, "within": True}
    assert best(rows, _cost, 20)["row"] == rows[1]
    assert best(rows, _cost, 40)["row"] == rows[2]


def test_scores_that_are_as_good_yield_to_the_cost():
    rows = [_row(20, 0.500), _row(10, 0.505), _row(5, 0.506)]
    assert best(rows, _cost, 33)["cost"] == 10


def test_a_budget_that_nothing_meets_is_told_with_the_nearest():
    rows = [_row(50, 0.1), _row(40, 0.9)]
    assert best(rows, _cost, 33) == {"row": rows[1], "cost": 40, "within": False}


def test_a_score_that_is_no_number_is_not_compared():
    with pytest.raises(ValueError, match="not finite"):
        best([_row(1, 0.5), _row(2, math.nan)], _cost, 33)


def _chosen(rows, best_int8="int8, float heads"):
    return {one["device"]: one for one in for_devices(rows, 2, {"live": best_int8})}


def test_each_device_looks_at_rows_of_its_own():
    rows = [
        _row(30, 0.3, gflop=100.0),
        _row(8, 0.4, threads=1, precision="float16"),
        _row(6, 0.5, threads=1),
        _row(25, 0.2, runtime="Keras", precision="bfloat16"),
        _row(1, 0.1, runtime="Keras", precision="float32", threads=1),
    ]
    chosen = _chosen(rows)
    # 8 ms five times over is more than a frame; Keras does not run on a phone.
    assert chosen["a phone-class CPU"]["row"] == rows[2]
    assert chosen["a phone-class CPU"]["cost"] == pytest.approx(30)
    assert chosen["this laptop"]["row"] == rows[3]
    assert chosen["a GPU"]["row"] == rows[0] and chosen["a GPU"]["within"]
    assert "not measured" in chosen["a GPU"]["rule"]


def test_of_eight_bits_only_what_validation_chose_is_taken():
    rows = [
        _row(20, 0.5),
        _row(10, 0.3, precision="int8"),
        _row(10, 0.4, precision="int8, float heads"),
        _row(20, 0.5, threads=1),
    ]
    assert _chosen(rows)["this laptop"]["row"] == rows[2]
    assert _chosen(rows, "int8")["this laptop"]["row"] == rows[1]


def test_nothing_within_a_devices_budget_is_said():
    chosen = _chosen([_row(100, 0.5, gflop=500.0), _row(150, 0.5, threads=1)])
    assert [one["within"] for one in chosen.values()] == [False] * 3
    assert chosen["a phone-class CPU"]["cost"] == pytest.approx(750)


def _model(name, latency, score):
    return _row(latency, score, model=name)


def test_of_models_those_are_told_that_no_other_makes_superfluous():
    rows = [
        _model("quick", 5, 0.7),
        _model("dull", 30, 0.6),
        _model("sharp", 25, 0.5),
        _model("slow quick", 6, 0.7),
    ]
    worth = for_purposes(rows)
    assert [(one["model"], one["beaten"]) for one in worth] == [
        ("sharp", ["dull"]),
        ("quick", ["slow quick"]),
    ]
    assert for_purposes(rows[::-1])[0]["model"] == "sharp"


def test_a_single_model_and_equal_ones_are_worth_it():
    assert [one["beaten"] for one in for_purposes([_model("live", 20, 0.0)])] == [[]]
    twins = for_purposes([_model("one", 20, 0.5), _model("other", 20, 0.5)])
    assert sorted(one["model"] for one in twins) == ["one", "other"]
