"""Compressed radiance: a round trip up to the ceiling, gradients at both ends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lime_keras.optics.dynamic_range import HIGHEST_COMPRESSED, compress, expand

CEILING = np.expm1(HIGHEST_COMPRESSED)


@given(st.floats(0, CEILING))
def test_round_trip(radiance):
    assert expand(compress(radiance)) == pytest.approx(radiance, rel=1e-12)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_expanding_stays_in_range(compressed):
    assert 0 <= expand(compressed) <= CEILING
    assert compress(compressed) >= 0


def test_dim_light_is_kept_and_zero_stays_zero():
    assert compress(0.0) == expand(0.0) == 0
    assert compress(-3.0) == expand(-3.0) == 0
    assert compress(1e-20) == pytest.approx(1e-20)
    assert expand(np.float32(1e-20)) == pytest.approx(1e-20)
    assert compress(np.e - 1) == pytest.approx(1)


def test_the_ceiling_fits_half_precision():
    ceiling = expand(np.array([HIGHEST_COMPRESSED, 12, 1e4, np.inf], np.float16))
    assert ceiling.dtype == np.float16 and np.isfinite(ceiling).all()
    assert (ceiling == ceiling[0]).all()
    assert compress(np.float16(65504)) > HIGHEST_COMPRESSED
    assert compress(np.inf) == np.inf and np.isnan(compress(np.nan)) and np.isnan(expand(np.nan))


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_gradients_are_finite_everywhere(dtype, differentiate):
    radiance = np.array([-1e4, -0.0, 0, 1e-7, 1, 1e4, 65504], dtype)
    value, [gradient] = differentiate(compress, radiance)
    assert np.isfinite(value).all() and np.isfinite(gradient).all() and (gradient >= 0).all()
    compressed = np.array([-1e4, -0.0, 0, 1, HIGHEST_COMPRESSED, 12, 1e4], dtype)
    value, [gradient] = differentiate(expand, compressed)
    assert value.dtype == dtype and np.isfinite(value).all() and np.isfinite(gradient).all()
    assert gradient[[0, -1]].tolist() == [0, 0]


def test_gradients_are_those_of_finite_differences(differentiate):
    step = 1e-6
    for curve, points in ((compress, [0.01, 1, 1000.0]), (expand, [0.01, 1, 7.0])):
        points = np.array(points)
        _, [gradient] = differentiate(curve, points)
        expected = (curve(points + step) - curve(points - step)) / (2 * step)
        np.testing.assert_allclose(gradient, expected, rtol=1e-5)
