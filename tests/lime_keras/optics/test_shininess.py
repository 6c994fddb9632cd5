"""Bins of the exponent: edges, ends, floors and the expected value."""

import numpy as np
import pytest
import tensorflow as tf
from hypothesis import given
from hypothesis import strategies as st

from lime_keras.optics import shininess

PROBABILITIES = st.lists(st.floats(0, 1), min_size=8, max_size=8).filter(lambda p: sum(p) > 1e-3)


def test_eight_equal_bins_from_one_to_a_thousand():
    np.testing.assert_allclose(shininess.LOG_EDGES, 0.375 * np.arange(9))
    np.testing.assert_allclose(shininess.LOG_MEANS, 0.375 * np.arange(8) + 0.1875)


def test_bins_are_told_by_their_exponents():
    assert shininess.bin_label(0) == "s 1–2.4" and shininess.bin_label(7) == "s 421.7–1000"


def test_everything_beyond_the_range_goes_to_the_end_bins():
    exponents = [0, -0.0, 1e-38, 0.999, 1, 999, 1000, 1e6, 1e38, np.inf]
    assert shininess.bin_of(exponents).tolist() == [0] * 5 + [7] * 5
    assert shininess.bin_of(np.ones((2, 3, 1))).shape == (2, 3, 1)
    assert shininess.bin_of([]).shape == (0,)


@given(st.floats(0, 3, exclude_max=True))
def test_bins_by_counting_edges(log):
    inside = min(abs(log - edge) for edge in shininess.LOG_EDGES) > 1e-5
    if inside:
        assert shininess.bin_of(10.0**log) == sum(log >= e for e in shininess.LOG_EDGES[1:8])


def test_bins_of_logarithms_are_those_of_their_exponents_in_either_backend():
    logs = np.concatenate([shininess.LOG_EDGES, np.linspace(-1, 4, 999)]).astype(np.float32)
    expected = shininess.bin_of(10.0 ** logs.astype(np.float64))
    for found in (shininess.bin_of_log(logs), shininess.bin_of_log(tf.constant(logs))):
        np.testing.assert_array_equal(found, expected)


def test_the_logarithm_of_an_exponent_below_one_is_zero_in_either_backend():
    exponents = np.float32([0, 1e-38, 0.5, 1, 10, 1000, np.inf])
    for found in (shininess.log_of(exponents), shininess.log_of(tf.constant(exponents))):
        np.testing.assert_allclose(found, [0, 0, 0, 0, 1, 3, np.inf], rtol=1e-6)


def test_the_floor_is_what_uniform_draws_give():
    log = (np.arange(80_000) + 0.5) / 80_000 * 3
    perfect = shininess.LOG_MEANS[shininess.bin_of(10.0**log)]
    assert np.abs(perfect - log).mean() == pytest.approx(shininess.QUANTISATION_FLOOR, rel=1e-3)


@given(PROBABILITIES)
def test_expected_value_stays_within_the_means(weights):
    probabilities = np.array(weights) / sum(weights)
    slow = sum(p * m for p, m in zip(probabilities, shininess.LOG_MEANS, strict=True))
    expected = shininess.log_expected(probabilities)
    assert expected == pytest.approx(slow, rel=1e-6)
    assert shininess.LOG_MEANS[0] - 1e-6 <= expected <= shininess.LOG_MEANS[-1] + 1e-6


@given(PROBABILITIES)
def test_entropy_lies_between_certain_and_knowing_nothing(weights):
    probabilities = np.array(weights) / sum(weights)
    assert -1e-9 <= shininess.entropy(probabilities) <= 3 + 1e-9


def test_certain_and_uniform():
    certain, uniform = np.eye(8), np.full((1, 8), 1 / 8)
    np.testing.assert_allclose(shininess.log_expected(certain), shininess.LOG_MEANS, rtol=1e-6)
    np.testing.assert_array_equal(shininess.entropy(certain), 0)
    np.testing.assert_allclose(shininess.log_expected(uniform), 1.5, rtol=1e-6)
    np.testing.assert_allclose(shininess.entropy(uniform), 3)
