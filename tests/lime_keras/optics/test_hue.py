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
    """Photos of objects of these albedos `(3, 3)` on all pixels."""
    rng = np.random.default_rng(seed)
    diffuse, glossy = rng.uniform(0.05, 1, (2, *SHAPE)) * brightness
    linear = compose(
        np.asarray(albedo, float), np.full(3, specular), np.full(3, 0.01), diffuse, glossy
    )
    return colour.linear_to_srgb(linear).astype(np.float32)


def albedos(seed, low=0.0):
    return np.random.default_rng(seed).uniform(low, 1, (3, 3)).astype(np.float32)


@given(st.integers(0, 2**31))
def test_the_hue_is_that_of_the_true_albedo(seed):
    true, estimate = albedos(seed), albedos(seed + 1)
    along, across = chroma(with_hue_of_pixels(estimate, scene(true, seed))), chroma(true)
    cosine = (along * across).sum(-1)
    np.testing.assert_allclose(
        cosine, np.linalg.norm(along, axis=-1) * np.linalg.norm(across, axis=-1), atol=1e-3
    )


def test_a_true_albedo_stays():
    true = albedos(1)
    np.testing.assert_allclose(with_hue_of_pixels(true, scene(true)), true, atol=2e-5)


def test_grey_part_and_saturation_stay():
    estimate = albedos(2)
    found = with_hue_of_pixels(estimate, scene(albedos(3)))
    assert np.abs(found - estimate).max() > 0.1
    np.testing.assert_allclose(found.mean(-1), estimate.mean(-1), atol=1e-6)
    lengths = [np.linalg.norm(chroma(rgb), axis=-1) for rgb in (found, estimate)]
    np.testing.assert_allclose(*lengths, atol=1e-6)


def test_grey_pixels_no_pixels_and_clipped_pixels_tell_nothing():
    estimate, image = albedos(4), scene(albedos(5))
    grey = scene([[0.5, 0.5, 0.5]] * 3)
    for seen in (grey, 0 * image, 0 * image + 1, np.where([True, False, False], 1, image)):
        np.testing.assert_array_equal(with_hue_of_pixels(estimate, seen), estimate)


def test_clipped_pixels_and_pixels_outside_the_object_do_not_count():
    estimate, image = albedos(6), scene(albedos(7))
    expected = with_hue_of_pixels(estimate, image[:, 3:])
    for colour_there in ([1.0, 0.1, 0.1], [0.0, 0.0, 0.0]):
        partly = image.copy()
        partly[:, :3] = colour_there
        np.testing.assert_allclose(with_hue_of_pixels(estimate, partly), expected, atol=1e-6)


@pytest.mark.parametrize("tint", [0.0, 1e-6, 0.01, 1.0])
@pytest.mark.parametrize("level", [0.0, 1e-30, 1e-6, 0.04045, 0.5, 0.9989, 1.0])
def test_extremes_stay_finite(tint, level):
    image = np.full((3, 4, 4, 3), level, np.float32)
    image[..., 0] *= 1 - tint
    for estimate in (np.zeros((3, 3)), np.ones((3, 3)), np.full((3, 3), 1e6), albedos(8)):
        found = with_hue_of_pixels(estimate.astype(np.float32), image)
        assert np.isfinite(found).all()
        if not np.ptp(estimate):  # what is grey has no hue to turn
            np.testing.assert_allclose(found, estimate, rtol=1e-6, atol=1e-9)


def test_tensors_as_arrays(differentiate):
    image, estimate = scene(albedos(9)), albedos(10)
    tensors = [ops.convert_to_tensor(value) for value in (estimate, image)]
    found = ops.convert_to_numpy(with_hue_of_pixels(*tensors))
    np.testing.assert_allclose(found, with_hue_of_pixels(estimate, image), atol=1e-6)
    for value in (estimate, np.full((3, 3), 0.5, np.float32), np.zeros((3, 3), np.float32)):
        _, [gradient] = differentiate(
            lambda albedo: ops.sum(with_hue_of_pixels(albedo, image)), value
        )
        assert np.isfinite(gradient).all()
