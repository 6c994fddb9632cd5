"""Table 1's measures against loops and by hand."""

import numpy as np
import pytest
import tensorflow as tf
from hypothesis import given
from hypothesis import strategies as st

from lime_keras import metrics


@given(st.integers(0, 2**31))
def test_iou_counts_pixels(seed):
    rng = np.random.default_rng(seed)
    mask, predicted = rng.uniform(size=(2, 3, 4, 5, 1)) * rng.uniform(0.3, 1)
    found = metrics.overlap_ratio(*metrics.overlap(mask, predicted))
    for b in range(3):
        pairs = [(t >= 0.5, p >= 0.5) for t, p in zip(mask[b].flat, predicted[b].flat, strict=True)]
        union = sum(t or p for t, p in pairs)
        expected = sum(t and p for t, p in pairs) / union if union else 1
        assert found[b] == pytest.approx(expected)


def test_relative_error_is_compaction_and_scale_free():
    rng = np.random.default_rng(0)
    shading, predicted = rng.exponential(size=(2, 3, 4, 5, 1))
    mask = rng.uniform(size=(3, 4, 5, 1))
    mask[2] = 0
    found, lit = metrics.masked_relative_error(shading, predicted, mask)
    for b in range(2):
        chosen = mask[b] >= 0.5
        difference = np.abs(predicted[b][chosen] - shading[b][chosen])
        assert found[b] == pytest.approx(difference.sum() / shading[b][chosen].sum())
    assert found[2] == 0 and lit.tolist() == [1, 1, 0]
    scaled, _ = metrics.masked_relative_error(shading * 1e4, predicted * 1e4, mask)
    assert scaled == pytest.approx(found)


def test_tensors_are_measured_as_arrays_are():
    rng = np.random.default_rng(1)
    images = rng.uniform(size=(3, 2, 4, 5, 1)).astype(np.float32)
    images[2, 1] = 0
    tensors = list(map(tf.constant, images))
    for one, other in (
        (metrics.overlap(*images[1:]), metrics.overlap(*tensors[1:])),
        (
            metrics.overlap_ratio(*metrics.overlap(*images[1:])),
            metrics.overlap_ratio(*metrics.overlap(*tensors[1:])),
        ),
        (metrics.masked_relative_error(*images), metrics.masked_relative_error(*tensors)),
    ):
        np.testing.assert_allclose(other, one, rtol=1e-6)
