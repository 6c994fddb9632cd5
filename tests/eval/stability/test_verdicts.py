"""Verdicts: which element is the worst, and what passes."""

import math

import numpy as np
import pytest

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome, joined


def judged(outcome):
    return Case("part", "case", "float32", lambda: outcome).judge()


def value(found, low, high=None, tolerance=0.0):
    return judged(Outcome(Compared(np.array(found), low, low if high is None else high, tolerance)))


def test_the_worst_element_is_the_one_nearest_its_own_tolerance():
    found = Compared(np.array([1.1, 5.0, 2.0]), [1.0, 4.0, 2.0], [1.0, 4.0, 2.0], [0.11, 9.0, 1.0])
    assert found.worst() == pytest.approx((1.1, 1.0, 0.1, 0.11))
    verdict = judged(Outcome(found))
    assert verdict.passed and verdict.error == pytest.approx(0.1)
    assert not value([1.1, 5.0], 1.0, tolerance=1.0).passed


def test_without_any_error_the_largest_is_told():
    assert value([0.0, -7.0, 3.0], np.array([0.0, -7.0, 3.0])).value == -7.0


@pytest.mark.parametrize(
    "found, low, high, passed",
    [
        (0.5, 0.0, 1.0, True),
        (0.0, 0.0, 1.0, True),
        (1.5, 0.0, 1.0, False),
        (-0.1, 0.0, 1.0, False),
        (math.inf, 10.0, math.inf, True),
        (9.0, 10.0, math.inf, False),
        (math.inf, 0.0, 1.0, False),
        (-math.inf, math.inf, math.inf, False),
        (math.inf, math.inf, math.inf, True),
        (math.nan, math.nan, math.nan, True),
        (math.nan, 0.0, 1.0, False),
        (math.nan, 0.0, math.inf, False),
        (1.0, math.nan, math.nan, False),
    ],
)
def test_what_lies_between_the_references_passes(found, low, high, passed):
    verdict = value(found, low, high)
    assert verdict.passed is passed
    assert verdict.error == 0 if passed else verdict.error > 0


def test_one_wrong_number_among_many_is_found():
    for wrong in (math.nan, math.inf, 2.0):
        found = np.ones((3, 4))
        found[1, 2] = wrong
        assert not value(found, np.ones((3, 4)), tolerance=1e-3).passed


def test_value_and_gradient_share_a_row_and_the_worse_is_compared():
    right, wrong = Compared(np.ones(2), 1.0, 1.0, 0.1), Compared(np.full(2, 3.0), 2.0, 2.0, 0.1)
    verdict = judged(Outcome(right, wrong, "why"))
    assert not verdict.passed and verdict.note == "error of the gradient; why"
    assert (verdict.value, verdict.gradient, verdict.reference) == (1.0, 3.0, 2.0)
    verdict = judged(Outcome(wrong, right))
    assert not verdict.passed and verdict.note == ""
    assert (verdict.value, verdict.gradient, verdict.reference) == (3.0, 1.0, 2.0)
    verdict = judged(Outcome(gradient=wrong))
    assert verdict.value is None and verdict.gradient == 3.0 and not verdict.passed


def test_joined_numbers_keep_their_own_references():
    parts = [Compared(np.ones((2, 2)), 1.0, 1.0, 0.0), Compared(np.array([5.0]), 4.0, 4.5, 1.0)]
    both = joined(parts)
    assert both.found.shape == (5,)
    assert both.worst() == (5.0, 4.5, 0.5, 1.0)


def test_what_a_part_raises_is_a_failure():
    def fails():
        raise TypeError("no such thing\nand more")

    case = Case("part", "case", "float32", fails)
    verdict = case.judge()
    assert not verdict.passed and verdict.note == "TypeError: no such thing"
    assert case.id == "part: case [float32]"
