"""Hue: by Eq. 4, all pixels of an object in grey light have the chroma direction of m_d."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from keras import ops

from lime_keras.optics import colour
from lime_keras.optics.compositing import compose
from lime_keras.optics.hue import with_hue_of_pixels

SHAPE = (3, 8, 9, 1)


def chroma(rgb):
    rgb = np.asarray(rgb, float)
    return rgb - rgb.mean(axis=-1, keepdims=True)


def scene(albedo, seed=0, brightness=0.3, specular=0.2):
    """Photos of objects of these albedos `(3, 3)` on all pixels, and their mask."""
    rng = np.random.default_rng(seed)
    diffuse, glossy = rng.uniform(0.05, 1, (2, *SHAPE)) * brightness
    linear = compose(
        np.asarray(albedo, float), np.full(3, specular), np.full(3, 0.01), diffuse, glossy
    )
    return colour.linear_to_srgb(linear).astype(np.float32), np.ones(SHAPE, np.float32)


def albedos(seed, low=0.0):
    return np.random.default_rng(seed).uniform(low, 1, (3, 3)).astype(np.float32)


@given(st.integers(0, 2**31))
def test_the_hue_is_that_of_the_true_albedo(seed):
    true, estimate = albedos(seed), albedos(seed + 1)
    found = with_hue_of_pixels(0.4 + 0.2 * estimate, *scene(true, seed))
    along, across = chroma(found), chroma(true)
    cosine = (along * across).sum(-1)
    np.testing.assert_allclose(
        cosine, np.linalg.norm(along, axis=-1) * np.linalg.norm(across, axis=-1), atol=1e-3
    )


def test_a_true_albedo_stays():
    true = albedos(1, low=0.1)
    np.testing.assert_allclose(with_hue_of_pixels(true, *scene(true)), true, atol=2e-5)


def test_grey_part_and_saturation_stay():
    estimate = 0.45 + 0.1 * albedos(2)
    found = with_hue_of_pixels(estimate, *scene(albedos(3)))
    np.testing.assert_allclose(found.mean(-1), estimate.mean(-1), atol=1e-6)
    lengths = [np.linalg.norm(chroma(rgb), axis=-1) for rgb in (found, estimate)]
    np.testing.assert_allclose(*lengths, atol=1e-6)


def test_a_colour_that_leaves_the_cube_is_cut_off():
    found = with_hue_of_pixels(np.float32([[1, 0, 0]] * 3), *scene([[0.0, 0.5, 0.0]] * 3))
    assert found.min() == 0 and found.max() <= 1
    assert (found.argmax(-1) == 1).all()


def test_grey_pixels_an_empty_mask_and_clipped_pixels_tell_nothing():
    estimate = albedos(4)
    image, mask = scene(albedos(5))
    grey, _ = scene([[0.5, 0.5, 0.5]] * 3)
    for seen, where in ((image, 0 * mask), (grey, mask), (0 * image, mask), (0 * image + 1, mask)):
        np.testing.assert_array_equal(with_hue_of_pixels(estimate, seen, where), estimate)


def test_clipped_pixels_do_not_count():
    image, mask = scene(albedos(6))
    partly = image.copy()
    partly[:, :3] = [1.0, 0.1, 0.1]
    without = mask.copy()
    without[:, :3] = 0
    estimate = albedos(7)
    np.testing.assert_allclose(
        with_hue_of_pixels(estimate, partly, mask),
        with_hue_of_pixels(estimate, image, without),
        atol=1e-6,
    )


def test_the_background_does_not_count():
    image, mask = scene(albedos(8))
    mask[:, 4:] = 0
    other = image.copy()
    other[:, 4:] = [0.1, 0.9, 0.2]
    estimate = albedos(9)
    np.testing.assert_array_equal(
        with_hue_of_pixels(estimate, image, mask), with_hue_of_pixels(estimate, other, mask)
    )


@pytest.mark.parametrize("mask_value", [0.0, 1e-30, 1e-3, 1.0])
@pytest.mark.parametrize("level", [0.0, 1e-6, 0.04045, 0.5, 0.9989, 1.0])
def test_extremes_stay_albedos(mask_value, level):
    image = np.full((3, 4, 4, 3), level, np.float32)
    image[..., 0] *= 0.999
    mask = np.full((3, 4, 4, 1), mask_value, np.float32)
    for estimate in (np.zeros((3, 3)), np.ones((3, 3)), albedos(10)):
        found = with_hue_of_pixels(estimate.astype(np.float32), image, mask)
        assert np.isfinite(found).all() and found.min() >= 0 and found.max() <= 1


def test_tensors_as_arrays(differentiate):
    image, mask = scene(albedos(11))
    estimate = albedos(12, low=0.3)
    expected = with_hue_of_pixels(estimate, image, mask)
    tensors = [ops.convert_to_tensor(value) for value in (estimate, image, mask)]
    found = ops.convert_to_numpy(with_hue_of_pixels(*tensors))
    np.testing.assert_allclose(found, expected, atol=1e-6)
    for value in (estimate, np.full((3, 3), 0.5, np.float32), np.zeros((3, 3), np.float32)):
        _, [gradient] = differentiate(
            lambda albedo: ops.sum(with_hue_of_pixels(albedo, image, mask)), value
        )
        assert np.isfinite(gradient).all()
