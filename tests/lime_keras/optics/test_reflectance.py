"""The normaliser: closed forms, limits, and gradients at every corner."""

import math

import numpy as np
import pytest

from lime_keras.optics.reflectance import normaliser


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
    exponent = np.geomspace(1e-3, 1e6, 41)
    np.testing.assert_allclose(differentiate(normaliser, exponent)[0], normaliser(exponent))
