"""Scores, fronts and choices of rows made by hand."""

import math

import pytest

from lime_keras.eval.tradeoff import recommendation
from lime_keras.eval.tradeoff.recommendation import (
    for_purposes,
    for_this_machine,
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


CHANCE = {
    "log_exponent_mae": 0.75,
    "diffuse_albedo_mae": 0.25,
    "specular_albedo_mae": 0.25,
    "specular_shading_relative": 1.0,
    "mirror_relative": 1.0,
}
ROW = {"errors": ERRORS, "chance": CHANCE}


def test_the_score_is_the_mean_of_error_over_chance():
    assert scored([ROW]) == list(recommendation.SCORED)
    assert score(ROW, scored([ROW])) == pytest.approx((0.5 + 0.2 + 1 + 0.5 + 1) / 5)
    assert score({"errors": CHANCE, "chance": CHANCE}, scored([ROW])) == 1


def test_a_measure_whose_truth_never_varies_is_not_scored():
    rows = [ROW, {"errors": ERRORS, "chance": CHANCE | {"diffuse_albedo_mae": 0.0}}]
    assert "diffuse_albedo_mae" not in scored(rows) and len(scored(rows)) == 4


def test_scores_compare_what_all_systems_answer():
    errors = {name: value for name, value in ERRORS.items() if name != "mirror_relative"}
    without = {"errors": errors, "chance": CHANCE}
    shared = scored([ROW, without])
    assert "mirror_relative" not in shared and len(shared) == 4
    assert score(ROW, shared) == score(without, shared) == pytest.approx(2.2 / 4)
    with pytest.raises(ValueError, match="share none of log_exponent_mae"):
        score(ROW, scored([ROW, {"errors": {}, "chance": {}}]))


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


def _chosen(*rows):
    return for_this_machine(rows, 2)


def test_the_best_is_the_least_score_within_a_frame():
    rows = [_row(10, 0.6), _row(33, 0.5), _row(34, 0.1)]
    chosen = _chosen(*rows)
    assert (chosen["row"], chosen["cost"], chosen["within"]) == (rows[1], 33, True)
    assert (chosen["device"], chosen["unit"]) == ("this machine", "ms")
    assert chosen["budget"] == pytest.approx(33.33, abs=0.01) and "all 2 threads" in chosen["rule"]


def test_of_scores_that_are_as_good_the_fastest_is_taken():
    assert _chosen(_row(20, 0.500), _row(10, 0.505), _row(5, 0.506))["cost"] == 10


def test_where_nothing_is_fast_enough_the_fastest_is_named():
    chosen = _chosen(_row(50, 0.1), _row(40, 0.9))
    assert (chosen["cost"], chosen["within"]) == (40, False)


def test_fewer_threads_than_the_machine_has_take_no_part():
    assert _chosen(_row(20, 0.5), _row(10, 0.1, threads=1))["cost"] == 20


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
