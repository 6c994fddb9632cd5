"""Curves against mpmath: slopes on both sides of a kink, tolerances that fit the condition."""

import mpmath
import numpy as np
import pytest
from keras import ops

from tests.stability import curves
from tests.stability.precisions import HALF, NUMPY_SINGLE, SINGLE, TENSORS


def judged(curve, exact, points, precisions=(SINGLE,)):
    return [case.judge() for case in curves.cases("part", curve, exact, points, precisions)]


def test_the_reference_knows_value_slope_and_curvature():
    value, slopes, curvature = curves.reference(mpmath.exp, 2.0, SINGLE.epsilon)
    assert value == pytest.approx(np.exp(2), rel=1e-15)
    assert slopes == pytest.approx([np.exp(2)] * 3, rel=1e-6)
    assert curvature == pytest.approx(np.exp(2), rel=1e-6)
    assert min(slopes) < np.exp(2) < max(slopes)


def test_at_a_kink_the_slopes_of_both_sides_are_right():
    for x in (0.0, 3.0):
        slopes = curves.reference(lambda y, x=x: abs(y - x), x, SINGLE.epsilon)[1]
        assert (min(slopes), max(slopes)) == pytest.approx((-1, 1))
    points = {"the kink": 0.0, "beside it": 0.5}
    assert all(v.passed for v in judged(ops.abs, abs, points, TENSORS))
    # The derivative of the maximum of equals is 1.
    assert not any(v.passed for v in judged(lambda x: 3 * ops.maximum(x, 0.0), _ramp, points))
    assert all(v.passed for v in judged(lambda x: ops.maximum(x, 0.0), _ramp, points))


def test_every_point_and_precision_that_can_hold_it_is_a_case():
    points = {"1": 1.0, "1e30": 1e30}
    cases = curves.cases("part", ops.abs, abs, points, (SINGLE, HALF, NUMPY_SINGLE))
    assert [(case.name, case.precision) for case in cases] == [
        ("1", "float32"),
        ("1", "float16"),
        ("1", "NumPy float32"),
        ("1e30", "float32"),
        ("1e30", "NumPy float32"),
    ]


@pytest.mark.parametrize("x", [0.1, 1.0, 30.0])
def test_an_error_of_a_few_roundings_passes_and_more_does_not(x):
    for factor, passed in ((1 + 2**-22, True), (1 + 2**-16, False)):
        [verdict] = judged(lambda y, f=factor: ops.exp(y) * f, mpmath.exp, {"x": x})
        assert verdict.passed is (passed or x == 30)  # exp's condition is 30 there
    [verdict] = judged(lambda y: ops.exp(y) * (1 + 2**-12), mpmath.exp, {"x": x})
    assert not verdict.passed


def test_a_wrong_derivative_of_a_right_value_fails():
    def half_blind(x):
        return ops.exp(x) / 2 + ops.stop_gradient(ops.exp(x) / 2)

    [verdict] = judged(half_blind, mpmath.exp, {"x": 1.0})
    assert not verdict.passed and verdict.note == "error of the gradient"
    assert verdict.gradient == pytest.approx(np.e / 2)


def test_what_is_not_finite_must_come_out_so():
    points = {"NaN": np.nan, "infinity": np.inf}
    assert all(v.passed for v in judged(ops.exp, mpmath.exp, points))
    silent = judged(lambda x: ops.where(ops.isnan(x), 0.0, x), mpmath.exp, points)
    assert [v.passed for v in silent] == [False, True]
    assert not any(v.passed for v in judged(lambda x: 0 * x + 1, mpmath.exp, points)[1:])


def test_an_overflow_of_the_format_is_right():
    assert judged(ops.square, lambda x: x * x, {"1e4": 1e4}, (HALF,))[0].passed
    assert not judged(lambda x: 0 * x + 5, lambda x: x * x, {"1e4": 1e4}, (HALF,))[0].passed


def _ramp(x):
    return max(x, mpmath.mpf(0))
