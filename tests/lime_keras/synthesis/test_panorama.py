"""Look-ups in batches of maps, against those of `optics.environment`."""

import keras
import numpy as np

from lime_keras.optics import environment
from lime_keras.synthesis import panorama


def _maps():
    return np.random.default_rng(0).random((3, 8, 16)).astype(np.float32)


def test_look_ups_are_those_of_single_maps():
    direction = np.random.default_rng(1).normal(size=(3, 40, 3)).astype(np.float32)
    direction[:, :3] = [[0, 1, 0], [0, -1, 0], [0, 0, 1]]
    at = panorama.place(*np.moveaxis(direction, -1, 0))
    found = keras.ops.convert_to_numpy(panorama.looked_up(_maps(), *at))
    for one, radiance, towards in zip(found, _maps(), direction, strict=True):
        np.testing.assert_allclose(one, environment.lookup(radiance, towards), atol=1e-5)


def test_reduced_maps_are_means_of_texels():
    found = keras.ops.convert_to_numpy(panorama.reduced(_maps(), 2))
    expected = _maps().reshape(3, 2, 4, 4, 4).mean(axis=(2, 4))
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    np.testing.assert_array_equal(panorama.reduced(_maps(), 8), _maps())
