"""The camera's error of white balance: gains of the channels that add no brightness."""

import numpy as np
import pytest
from keras import ops

from lime_keras.optics import camera_law

ENDS = np.array([camera_law.CAST, camera_law.TINT, camera_law.UNEVEN, camera_law.UNEVEN])
PLACES = camera_law.places(8)


def drawn(seed, count=3):
    return camera_law.cast(np.random.default_rng(seed).uniform(size=(count, 4)).astype(np.float32))


def test_casts_fill_their_ranges_evenly_about_none():
    np.testing.assert_allclose(camera_law.cast(np.full((1, 4), 0.5)), 0, atol=1e-7)
    np.testing.assert_allclose(camera_law.cast(np.ones(4)), ENDS, rtol=1e-6)
    np.testing.assert_allclose(camera_law.cast(np.zeros(4)), -ENDS, rtol=1e-6)
    np.testing.assert_allclose(camera_law.cast(np.full(4, 0.75)), ENDS / 2, rtol=1e-6)


@pytest.mark.parametrize("size", [1, 2, 7, 128])
def test_places_are_the_middles_of_pixels(size):
    found = camera_law.places(size)
    assert found.shape == (size,) and found.dtype == np.float32
    np.testing.assert_allclose(found, -found[::-1], atol=1e-7)
    np.testing.assert_allclose(np.diff(found), 2 / size, rtol=1e-4)
    assert found[-1] == pytest.approx(1 - 1 / size)


@pytest.mark.parametrize("seed", range(4))
def test_logarithms_of_the_gains_sum_to_nothing(seed):
    gains = camera_law.balance(drawn(seed), PLACES)
    assert gains.shape == (3, 8, 8, 3)
    np.testing.assert_allclose(np.log(gains).sum(axis=-1), 0, atol=1e-6)


def test_without_a_cast_all_gains_are_one():
    np.testing.assert_array_equal(camera_law.balance(np.zeros((2, 4), np.float32), PLACES), 1)


def test_each_number_of_a_cast_has_its_meaning():
    red_over_blue, green, right, down = (
        np.log(camera_law.balance(0.1 * np.eye(4, dtype=np.float32)[index : index + 1], PLACES))[0]
        for index in range(4)
    )
    # Even: the logarithm of red over blue is the first number, that of green the second.
    np.testing.assert_allclose(red_over_blue[..., 0] - red_over_blue[..., 2], 0.1, atol=1e-6)
    np.testing.assert_allclose(red_over_blue[..., 1], 0, atol=1e-6)
    np.testing.assert_allclose(green[..., 1], 0.1, atol=1e-6)
    np.testing.assert_allclose(green[..., 0], green[..., 2], atol=1e-6)
    # Uneven: the slope of red over blue over half the image, to the right and down.
    for slope, across in ((right, PLACES[None, :]), (down, PLACES[:, None])):
        expected = np.broadcast_to(0.1 * across, (8, 8))
        np.testing.assert_allclose(slope[..., 0] - slope[..., 2], expected, atol=1e-6)
        np.testing.assert_allclose(slope[..., 1], 0, atol=1e-6)


def test_tensors_as_arrays():
    cast = drawn(11)
    tensor = camera_law.balance(ops.convert_to_tensor(cast), PLACES)
    np.testing.assert_allclose(
        ops.convert_to_numpy(tensor), camera_law.balance(cast, PLACES), rtol=1e-6
    )
