"""The guided filter against its definition, where it must be exact, and at the extremes."""

import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from keras import ops

from lime_keras.networks import SUBNETWORKS
from lime_keras.networks.guided_filter import GuidedFilter, filtered

SIZE, REACH, NOISE = 32, 2, 0.01


def run(mask, image):
    return ops.convert_to_numpy(filtered(mask, image))


def pictures(seed, count=1):
    """Masks and pictures of noise."""
    rng = np.random.default_rng(seed)
    shape = count, SIZE, SIZE
    return rng.random((*shape, 1)).astype(np.float32), rng.random((*shape, 3)).astype(np.float32)


def windows(size=SIZE):
    """The slice of the window around each pixel of a side."""
    return [slice(max(0, k - REACH), k + REACH + 1) for k in range(size)]


def by_definition(mask, image):
    """The filter by He, Sun and Tang, one window after the other, in double precision."""
    image, mask = image.astype(np.float64), mask.astype(np.float64)
    fits = np.zeros((SIZE, SIZE, 4))
    for i, rows in enumerate(windows()):
        for j, columns in enumerate(windows()):
            colours = image[rows, columns].reshape(-1, 3)
            values = mask[rows, columns].ravel()
            spread = np.cov(colours.T, bias=True) + NOISE**2 * np.eye(3)
            together = (colours - colours.mean(0)).T @ (values - values.mean()) / len(values)
            slopes = np.linalg.solve(spread, together)
            fits[i, j] = *slopes, values.mean() - slopes @ colours.mean(0)
    out = np.zeros((SIZE, SIZE))
    for i, rows in enumerate(windows()):
        for j, columns in enumerate(windows()):
            mean = fits[rows, columns].reshape(-1, 4).mean(0)
            out[i, j] = mean[:3] @ image[i, j] + mean[3]
    return out


@pytest.mark.parametrize("contrast", [1.0, 0.1, 0.001])
def test_it_is_the_filter_of_its_definition(contrast):
    mask, image = pictures(0)
    image = 0.5 + contrast * (image - 0.5)
    expected = by_definition(mask[0, ..., 0], image[0])
    np.testing.assert_allclose(run(mask, image)[0, ..., 0], expected, atol=2e-4)


@given(st.integers(0, 2**31), st.integers(-1, 1))
def test_an_edge_moves_to_that_of_the_picture(seed, moved):
    rng = np.random.default_rng(seed)
    behind, object_colour = rng.random((2, 3))
    assume(np.abs(behind - object_colour).max() > 0.2)
    along = np.arange(SIZE)
    true = np.broadcast_to((along >= SIZE // 2)[:, None, None], (1, SIZE, SIZE, 1))
    image = np.where(true, object_colour, behind).astype(np.float32)
    mask = np.roll(true, moved, axis=1) * (along[:, None, None] > 4) | (along > 28)[:, None, None]
    found = run(mask.astype(np.float32), image)
    assert np.array_equal(found >= 0.5, true)


def test_masks_of_a_batch_are_filtered_alone_and_mirror_with_their_pictures():
    mask, image = pictures(1, count=3)
    found = run(mask, image)
    np.testing.assert_allclose(run(mask[1:2], image[1:2]), found[1:2], atol=1e-5)
    for turn in ([slice(None), slice(None, None, -1)], [slice(None)] * 2 + [slice(None, None, -1)]):
        turned = run(mask[tuple(turn)], image[tuple(turn)])
        np.testing.assert_allclose(turned, found[tuple(turn)], atol=2e-5)


@pytest.mark.parametrize("level", [0.0, 0.5, 1.0])
def test_a_picture_of_one_colour_leaves_the_mean_of_the_mask(level):
    mask = np.full((1, SIZE, SIZE, 1), 0.3, np.float32)
    image = np.full((1, SIZE, SIZE, 3), level, np.float32)
    np.testing.assert_allclose(run(mask, image), mask, atol=1e-6)


@given(
    st.integers(0, 2**31),
    st.sampled_from([0.0, 1e-30, 1e-6, 1e-3, 1.0]),
    st.sampled_from([0.0, 0.5, 1.0]),
    st.sampled_from([1.0, 1e4, 3e38]),
    st.sampled_from([np.float32, np.float16]),
)
def test_the_extremes_are_finite_and_near_the_range_of_masks(seed, contrast, level, scale, dtype):
    mask, image = pictures(seed)
    image = np.clip(level + contrast * (image - 0.5), 0, 1).astype(dtype).astype(np.float32)
    found = run((mask - 0.5) * np.float32(scale), image)
    assert np.isfinite(found).all() and found.min() > -0.6 and found.max() < 1.6


def test_training_sees_masks_as_they_are_and_others_see_them_stretched():
    mask, image = pictures(2)
    layer = GuidedFilter()
    assert np.array_equal(ops.convert_to_numpy(layer([mask, image], training=True)), mask)
    found = ops.convert_to_numpy(layer([mask, image]))
    np.testing.assert_allclose(found, 2 * (run(mask, image) - 0.5) + 0.5, atol=1e-6)


def test_a_pretrained_segmentation_net_filters_its_mask(tiny):
    network = SUBNETWORKS["segmentation"].build(dataclasses.replace(tiny, pretrained=True))
    rng = np.random.default_rng(3)
    network.set_weights([rng.normal(0, 0.1, one.shape) for one in network.get_weights()])
    _, image = pictures(3, count=2)
    before = network(image, training=True)
    found = ops.convert_to_numpy(network(image))
    expected = ops.convert_to_numpy(GuidedFilter()([before, image]))
    assert np.abs(found - ops.convert_to_numpy(before)).max() > 1e-3
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)
