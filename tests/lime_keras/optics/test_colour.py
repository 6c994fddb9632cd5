"""sRGB and YUV: round trips, known values, gradients at the knee and beyond the range."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lime_keras.optics import colour

UNIT = st.floats(0, 1, allow_nan=False)


def test_known_values():
    srgb = np.array([0.0, 0.04045, 0.5, 188 / 255, 1.0])
    linear = [0.0, 0.0031308, 0.21404114, 0.50288646, 1.0]
    np.testing.assert_allclose(colour.srgb_to_linear(srgb), linear, rtol=1e-5)


@given(st.floats(-0.5, 100))
def test_round_trip_even_beyond_the_range(value):
    value = np.float64(value)
    there_and_back = colour.linear_to_srgb(colour.srgb_to_linear(value))
    assert there_and_back == pytest.approx(value, rel=1e-5, abs=1e-7)
    back_and_there = colour.srgb_to_linear(colour.linear_to_srgb(value))
    assert back_and_there == pytest.approx(value, rel=1e-5, abs=1e-7)


def test_every_byte_survives_single_precision():
    bytes_ = np.arange(256)
    linear = colour.srgb_to_linear((bytes_ / 255).astype(np.float32))
    assert linear.dtype == np.float32
    back = colour.linear_to_srgb(linear)
    np.testing.assert_array_equal(np.round(back * 255), bytes_)


@pytest.mark.parametrize("curve", [colour.srgb_to_linear, colour.linear_to_srgb])
def test_curves_rise_and_join_at_the_knee(curve):
    x = np.linspace(-0.2, 4, 20_001)
    steps = np.diff(curve(x))
    assert (steps > 0).all() and steps.max() < 0.01


@given(st.tuples(UNIT, UNIT, UNIT))
def test_yuv_round_trip_inside_its_box(rgb):
    yuv = colour.rgb_to_yuv(np.array(rgb))
    np.testing.assert_allclose(colour.yuv_to_rgb(yuv), rgb, atol=1e-12)
    assert (yuv >= colour.YUV_LOW - 1e-12).all() and (yuv <= colour.YUV_HIGH + 1e-12).all()


def test_the_yuv_box_is_the_smallest():
    cube = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(-1, 3)
    yuv = colour.rgb_to_yuv(cube.astype(float))
    np.testing.assert_allclose(yuv.min(0), colour.YUV_LOW, atol=1e-12)
    np.testing.assert_allclose(yuv.max(0), colour.YUV_HIGH, atol=1e-12)


def test_luminance_of_white_is_one_and_green_weighs_most():
    assert colour.luminance(np.ones((2, 5, 3))) == pytest.approx(np.ones((2, 5)))
    assert colour.luminance(np.eye(3)) == pytest.approx([0.2126, 0.7152, 0.0722], abs=1e-6)
    assert colour.luminance(np.ones(3, np.float16)).dtype == np.float16
