"""Scores, fronts and the advice of rows made by hand."""

import math

import pytest
import trade

from lime_keras.eval.tradeoff import recommendation
from lime_keras.eval.tradeoff.recommendation import advise, commands, front, score, scored


def test_a_score_is_the_mean_of_error_over_chance():
    row = {"errors": {"a": 0.2, "b": 0.3}, "chance": {"a": 0.4, "b": 1.0}}
    assert score(row, ["a", "b"]) == pytest.approx(0.4)
    with pytest.raises(ValueError, match="no error"):
        score(row, [])


def test_only_what_all_models_have_is_scored():
    whole = {name: 0.1 for name in recommendation.SCORED}
    partly = {name: 0.1 for name in recommendation.SCORED[:3]}
    chance = dict.fromkeys(recommendation.SCORED, 1.0) | {recommendation.SCORED[0]: 0.0}
    rows = [{"errors": whole, "chance": chance}, {"errors": partly, "chance": chance}]
    assert scored(rows) == list(recommendation.SCORED[1:3])


def test_the_front_is_what_nothing_beats_in_both():
    assert front([(4, 1), (2, 6), (1, 9), (3, 5), (2, 5), (4, 1)]) == [(1, 9), (2, 5), (4, 1)]
    with pytest.raises(ValueError, match="not finite"):
        front([(1, math.nan)])


def test_the_advice_is_what_is_fast_enough_and_errs_least():
    photo, camera, light = advise(trade.ROWS)
    assert (photo["row"]["model"], photo["row"]["precision"]) == ("best", "float32")
    # live in float32 takes 60 ms for the material, in eight bits 20.
    assert (camera["row"]["model"], camera["row"]["precision"]) == ("live", "int8")
    assert camera["within"] and light["row"]["precision"] == "int8"
    slow = [row | {"ms": 10 * row["ms"]} for row in trade.ROWS]
    assert [one["within"] for one in advise(slow)] == [True, False, False]
    # Of two that err alike, the faster one; the images cannot tell scores so near apart.
    for more, model in ((1.005, "live"), (1.02, "best")):
        near = photo["row"] | {"model": "live", "score": more * photo["row"]["score"]}
        near["ms"] = 0.5 * photo["row"]["ms"]
        assert advise([*trade.ROWS, near])[0]["row"]["model"] == model
    # Nearly as fast, what has to be written first is not advised.
    twin = photo["row"] | {"precision": "float16", "ms": 0.95 * photo["row"]["ms"]}
    assert advise([*trade.ROWS, twin])[0]["row"]["precision"] == "float32"
    assert (
        advise([*trade.ROWS, twin | {"ms": 0.8 * twin["ms"]}])[0]["row"]["precision"] == "float16"
    )


def test_the_advice_can_be_typed():
    """The options exist, and take what is advised."""
    from lime_keras.commands import estimate, export, live

    parsers = {
        "lime-estimate": estimate.parser(),
        "lime-export": export.parser(),
        "lime-live": live.parser(),
    }
    typed = [command for one in advise(trade.ROWS) for command in one["commands"]]
    assert any("int8" in command for command in typed)
    typed += commands(trade.ROWS[0] | {"precision": "float16"})
    for command in typed:
        name, *arguments = command.split()
        parsers[name].parse_args(arguments)
    assert commands(trade.ROWS[0]) == ["lime-estimate PHOTO --weights best"]
    of_run = trade.ROWS[0] | {"weights": "my runs/best"}
    assert commands(of_run) == ["lime-estimate PHOTO --weights 'my runs/best'"]
