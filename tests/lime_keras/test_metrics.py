"""Table 1's measures against loops and by hand."""

import numpy as np
import pytest
import tensorflow as tf
from hypothesis import given
from hypothesis import strategies as st

from lime_keras import metrics
from lime_keras.optics import shininess


@given(st.integers(0, 2**31))
def test_iou_counts_pixels(seed):
    rng = np.random.default_rng(seed)
    mask, predicted = rng.uniform(size=(2, 3, 4, 5, 1)) * rng.uniform(0.3, 1)
    found = metrics.intersection_over_union(mask, predicted)
    for b in range(3):
        pairs = [(t >= 0.5, p >= 0.5) for t, p in zip(mask[b].flat, predicted[b].flat, strict=True)]
        union = sum(t or p for t, p in pairs)
        expected = sum(t and p for t, p in pairs) / union if union else 1
        assert found[b] == pytest.approx(expected)


def test_iou_by_hand():
    empty, full = np.zeros((1, 2, 2, 1)), np.ones((1, 2, 2, 1))
    half = np.array([1, 0, 1, 0.0]).reshape(1, 2, 2, 1)
    for mask, predicted, expected in (
        (full, full, 1),
        (empty, empty, 1),
        (empty, full, 0),
        (full, empty, 0),
        (half, full, 0.5),
        (half, 1 - half, 0),
        (full * 0.5, full * 0.5, 1),
        (full, full * 0.5, 1),
        (full, full * 0.49, 0),
        (full, full * np.nan, 0),
    ):
        assert metrics.intersection_over_union(mask, predicted).tolist() == [expected]


@pytest.mark.parametrize("channels", [1, 3])
def test_albedo_errors(channels):
    true, predicted = np.random.default_rng(0).uniform(size=(2, 6, channels))
    np.testing.assert_allclose(
        metrics.albedo_absolute_error(true, predicted),
        [
            sum(abs(t - p) for t, p in zip(*row, strict=True)) / channels
            for row in zip(true, predicted, strict=True)
        ],
    )
    squares = metrics.albedo_squared_error(true, predicted)
    assert squares == pytest.approx(np.linalg.norm(true - predicted, axis=1) ** 2 / channels)
    assert (metrics.albedo_absolute_error(true, true) == 0).all()


def test_a_constant_guess_scores_chance():
    drawn = ((np.arange(10_000) + 0.5) / 10_000)[:, None]
    middle = np.full_like(drawn, 0.5)
    assert metrics.albedo_absolute_error(drawn, middle).mean() == pytest.approx(0.25)
    assert metrics.albedo_squared_error(drawn, middle).mean() == pytest.approx(1 / 12)


def test_bin_distance_of_every_pair():
    exponents = 10.0 ** np.repeat(shininess.LOG_MEANS, 8)
    probabilities = np.tile(np.eye(8), (8, 1))
    expected = np.abs(np.arange(8)[:, None] - np.arange(8)).reshape(-1)
    np.testing.assert_array_equal(metrics.bin_distance(exponents, probabilities), expected)


def test_log_exponent_error_counts_decades_either_way():
    found = metrics.log_exponent_error(np.array([10, 100, 1000.0]), np.array([2, 2, 2.5]))
    assert found == pytest.approx([1, 0, 0.5])


def test_relative_error_is_compaction_and_scale_free():
    rng = np.random.default_rng(0)
    shading, predicted = rng.exponential(size=(2, 3, 4, 5, 1))
    mask = rng.uniform(size=(3, 4, 5, 1))
    mask[2] = 0
    found = metrics.masked_relative_error(shading, predicted, mask)
    for b in range(2):
        chosen = mask[b] >= 0.5
        difference = np.abs(predicted[b][chosen] - shading[b][chosen])
        assert found[b] == pytest.approx(difference.sum() / shading[b][chosen].sum())
    assert found[2] == 0
    scaled = metrics.masked_relative_error(shading * 1e4, predicted * 1e4, mask)
    assert scaled == pytest.approx(found)


def test_tensors_are_measured_as_arrays_are():
    rng = np.random.default_rng(1)
    images = rng.uniform(size=(3, 2, 4, 5, 1)).astype(np.float32)
    images[2, 1] = 0
    tensors = list(map(tf.constant, images))
    for one, other in (
        (metrics.overlap(*images[1:]), metrics.overlap(*tensors[1:])),
        (
            metrics.intersection_over_union(*images[1:]),
            metrics.intersection_over_union(*tensors[1:]),
        ),
        (metrics.masked_relative_error(*images), metrics.masked_relative_error(*tensors)),
    ):
        np.testing.assert_allclose(other, one, rtol=1e-6)


def test_relative_error_of_black_is_one_and_of_the_truth_zero():
    shading, mask = np.full((1, 2, 2, 1), 3.0), np.ones((1, 2, 2, 1))
    assert metrics.masked_relative_error(shading, shading, mask) == [0]
    assert metrics.masked_relative_error(shading, 0 * shading, mask) == [1]
    assert metrics.masked_relative_error(0 * shading, shading, mask) == [0]
