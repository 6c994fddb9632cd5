"""The masked mean is the mean of the selected elements; an empty mask gives 0."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lime_keras.optics.masking import masked_mean


def field(channels=3, dtype=np.float64, shape=(4, 5, 6)):
    return np.random.default_rng(0).normal(size=(*shape, channels)).astype(dtype)


@given(st.integers(0, 2**31), st.sampled_from([0.05, 0.5, 1.0]), st.sampled_from([1, 3]))
def test_a_binary_mask_is_compaction(seed, share, channels):
    mask = np.random.default_rng(seed).uniform(size=(4, 5, 6, 1)) < share
    values = field(channels)
    found = masked_mean(values, mask.astype(float))
    for b in range(4):
        chosen = values[b][mask[b, ..., 0]]
        assert found[b] == pytest.approx(chosen.mean() if chosen.size else 0)


def test_fractional_coverage_weighs():
    values, mask = field(), np.random.default_rng(1).uniform(size=(4, 5, 6, 1))
    for b, found in enumerate(masked_mean(values, mask)):
        weights = np.broadcast_to(mask[b], values[b].shape)
        assert found == pytest.approx(np.average(values[b], weights=weights))


@pytest.mark.parametrize("garbage", [np.nan, np.inf, -np.inf, 1e38])
def test_what_lies_outside_the_mask_is_ignored(garbage, differentiate):
    values, mask = field(dtype=np.float32), np.ones((4, 5, 6, 1), np.float32)
    mask[:, 2:] = 0
    dirty = np.where(mask > 0, values, np.float32(garbage))
    found, [gradient] = differentiate(lambda v: masked_mean(v, mask), dirty)
    np.testing.assert_allclose(found, values[:, :2].mean((1, 2, 3)), rtol=1e-5)
    np.testing.assert_allclose(gradient, np.broadcast_to(mask / 36, values.shape), rtol=1e-5)


def test_one_examples_mask_does_not_touch_another():
    values, mask = field(), np.ones((4, 5, 6, 1))
    mask[2] = 0
    found = masked_mean(values, mask)
    assert found[2] == 0
    np.testing.assert_allclose(found[[0, 1, 3]], values[[0, 1, 3]].mean((1, 2, 3)))


def test_not_a_number_inside_the_mask_is_not_hidden():
    values, mask = field(), np.ones((4, 5, 6, 1))
    values[1, 0, 0, 0] = np.nan
    assert np.isnan(masked_mean(values, mask)).tolist() == [False, True, False, False]
