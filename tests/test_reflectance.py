"""The lobe and its normaliser: closed forms, limits, and gradients at every corner."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lime_keras.reflectance import lobe, normaliser

EXPONENTS = [0.0, 1e-6, 0.01, 0.5, 1.0, 2.37, 1e3, 1e6]
COSINES = [-1.0, -1e-38, -0.0, 0.0, 1e-38, 1e-30, 1e-15, 1e-10, 1e-3, 0.5, 1.0]
SQUARABLE = 1e15  # Adam squares gradients in float32


@given(st.floats(1e-3, 1), st.floats(0, 1e3))
def test_lobe_is_the_power(cosine, exponent):
    assert lobe(cosine, exponent) == pytest.approx(cosine**exponent, rel=1e-9, abs=1e-300)


@pytest.mark.parametrize("exponent", EXPONENTS)
def test_lobe_is_zero_behind_and_one_on_the_axis(exponent):
    assert (lobe(np.array([-1.0, -0.5, -1e-38, -0.0, 0.0]), exponent) == 0).all()
    assert lobe(1.0, exponent) == 1


def test_lobe_of_exponent_zero_is_a_step():
    np.testing.assert_array_equal(lobe(np.array([-0.1, 0, 1e-38, 0.3, 1]), 0.0), [0, 0, 1, 1, 1])


@pytest.mark.parametrize("exponent", EXPONENTS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_gradients_of_the_lobe_can_be_squared(exponent, dtype, differentiate):
    cosine = np.array(COSINES, dtype)
    exponents = np.full_like(cosine, exponent)
    value, gradients = differentiate(lobe, cosine, exponents)
    assert value.dtype == dtype
    assert np.isfinite(value).all() and (value >= 0).all() and (value <= 1).all()
    for gradient in gradients:
        assert np.isfinite(gradient).all() and np.abs(gradient).max() < SQUARABLE
        assert (gradient[: COSINES.index(1e-38)] == 0).all()


@given(st.floats(1e-38, 1), st.floats(1e-6, 1e6))
def test_no_gradient_of_the_lobe_overflows_when_squared(cosine, exponent):
    import tensorflow as tf

    variables = tf.constant(cosine, tf.float32), tf.constant(exponent, tf.float32)
    with tf.GradientTape() as tape:
        tape.watch(variables)
        value = lobe(*variables)
    assert 0 <= value <= 1
    assert all(abs(gradient) < SQUARABLE for gradient in tape.gradient(value, variables))


def test_gradients_of_the_lobe_are_those_of_finite_differences(differentiate):
    cosine, exponent = map(np.ravel, np.meshgrid([0.05, 0.4, 0.99], [0.3, 1, 7.5, 90]))
    step = 1e-6
    _, [by_cosine, by_exponent] = differentiate(lobe, cosine, exponent)
    expected = (lobe(cosine + step, exponent) - lobe(cosine - step, exponent)) / (2 * step)
    np.testing.assert_allclose(by_cosine, expected, rtol=1e-4, atol=1e-9)
    expected = (lobe(cosine, exponent + step) - lobe(cosine, exponent - step)) / (2 * step)
    np.testing.assert_allclose(by_exponent, expected, rtol=1e-4, atol=1e-9)


def test_half_precision_lobe():
    cosine = np.array([-1, -0.0, 0, 6e-8, 0.5, 1], np.float16)
    for exponent in (0, 0.5, 1, 1000):
        value = lobe(cosine, np.float16(exponent))
        assert np.isfinite(value).all() and value.max() <= 1


@pytest.mark.parametrize("exponent", [0, 1, 2.37, 10, 100, 1000])
def test_normaliser_makes_a_furnace_one(exponent):
    """S at n = o: h lies at half the light's angle θ, so ∫ cos(θ/2)^s 2π sin θ dθ · c = 1."""
    theta = (np.arange(200_000) + 0.5) * (math.pi / 2 / 200_000)
    integral = np.sum(np.cos(theta / 2) ** exponent * np.sin(theta)) * (math.pi / 2 / 200_000)
    assert 2 * math.pi * integral * normaliser(exponent) == pytest.approx(1, rel=1e-6)


def test_normaliser_at_its_ends():
    assert normaliser(0.0) == pytest.approx(1 / (2 * math.pi), rel=1e-12)
    assert normaliser(1e6) == pytest.approx((1e6 + 2) / (8 * math.pi), rel=1e-12)


def test_normaliser_is_linear_far_out_and_rises_everywhere():
    exponents = np.concatenate([[0], np.geomspace(1e-6, 1e6, 1000)])
    assert (np.diff(normaliser(exponents)) > 0).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_gradients_of_the_normaliser(dtype, differentiate):
    exponents = np.array([0, 1e-6, 1, 1e3, 1e6], dtype)
    value, [gradient] = differentiate(normaliser, exponents)
    assert value.dtype == dtype and np.isfinite(value).all()
    assert (gradient > 0).all() and (gradient <= 1 / (8 * math.pi) * (1 + 1e-5)).all()
    step = 1e-5
    wide = exponents.astype(np.float64)
    expected = (normaliser(wide + step) - normaliser(wide - step)) / (2 * step)
    np.testing.assert_allclose(gradient, expected, rtol=1e-4)


def test_tensors_and_arrays_agree(differentiate):
    cosine, exponent = np.linspace(-1, 1, 41), np.full(41, 12.5)
    np.testing.assert_allclose(differentiate(lobe, cosine, exponent)[0], lobe(cosine, exponent))
    np.testing.assert_allclose(differentiate(normaliser, exponent)[0], normaliser(exponent))
