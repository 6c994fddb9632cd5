"""Number formats: what they hold, what they may err by, and what computes in them."""

import numpy as np
import pytest
from keras import ops

from tests.stability.precisions import (
    ARRAYS,
    BRAIN,
    HALF,
    NUMPY_DOUBLE,
    SINGLE,
    TENSORS,
    XLA,
)

ALL = (*TENSORS, *ARRAYS)


@pytest.mark.parametrize("precision", ALL, ids=lambda p: p.name)
def test_formats_are_what_they_say(precision):
    one = precision.array(1.0)
    assert precision.rounded(1 + precision.epsilon) == 1 + precision.epsilon
    assert precision.rounded(1 + precision.epsilon / 4) == 1
    assert float(one.astype(np.float64)) == 1
    assert precision.rounded(precision.largest) == precision.largest
    assert precision.rounded(precision.least) == precision.least


def test_a_format_holds_what_it_tells_from_0_and_infinity():
    assert all(p.holds(x) for p in ALL for x in (0.0, -0.0, 1.0, np.inf, np.nan))
    assert not HALF.holds(1e30) and not HALF.holds(1e-30) and HALF.holds(65504.0)
    assert BRAIN.holds(1e30) and BRAIN.holds(1e-30) and not SINGLE.holds(1e-60)
    assert NUMPY_DOUBLE.holds(1e-60)


def test_tolerance_grows_with_size_and_terms():
    assert SINGLE.tolerance(1.0) == pytest.approx(9 * 2**-23)
    assert SINGLE.tolerance(-4.0) == pytest.approx(36 * 2**-23)
    assert SINGLE.tolerance(1.0, terms=64) == pytest.approx(16 * 2**-23)
    assert 0 < SINGLE.tolerance(0.0) < 1e-36


def test_beyond_the_range_infinity_is_right_and_nan_is_not():
    for sign in (1, -1):
        expected = sign * 1e6
        assert HALF.compare(sign * np.inf, expected, expected, 1e6).worst()[2] == 0
        assert HALF.compare(-sign * np.inf, expected, expected, 1e6).worst()[2] == np.inf
        assert HALF.compare(np.nan, expected, expected, 1e6).worst()[2] == np.inf
        assert HALF.compare(sign * 100.0, expected, expected, 0.0).worst()[2] > 6e4
        infinite = sign * np.inf
        assert SINGLE.compare(sign * 3e38, infinite, infinite, 0.0).worst()[2] == np.inf
    assert SINGLE.compare(2.0, 1.0, 3.0, 0.0).worst()[2] == 0


@pytest.mark.parametrize("precision", TENSORS, ids=lambda p: p.name)
def test_tensors_are_differentiated_by_every_argument(precision):
    value, gradients = precision.evaluate(_product, [1.0, 2.0], [4.0, 0.5])
    np.testing.assert_array_equal(value, [4, 1])
    np.testing.assert_array_equal(gradients, [[4, 0.5], [1, 2]])
    assert value.dtype == np.float64
    np.testing.assert_array_equal(precision.value(_product, [3.0], [2.0]), [6])


@pytest.mark.parametrize("precision", ALL, ids=lambda p: p.name)
def test_functions_see_the_format(precision):
    value, gradients = precision.evaluate(_thirds, [1.0])
    assert value[0] == precision.rounded(1 / 3) != 1 / 3 or precision is NUMPY_DOUBLE
    assert bool(gradients) == (precision in TENSORS)


def test_xla_compiles():
    eager = []

    def function(x):
        eager.append(not ops.is_tensor(x) or hasattr(x, "numpy"))
        return 2 * x

    XLA.evaluate(function, [1.0])
    SINGLE.evaluate(function, [1.0])
    assert eager == [False, True]


def _product(a, b):
    return a * b


def _thirds(x):
    return x / 3
