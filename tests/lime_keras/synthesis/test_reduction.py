"""Reduced batches against `pipeline.resize`."""

import numpy as np
import pytest
import tensorflow as tf
from sphere_corpus import example

from lime_keras.data import camera, pipeline, records
from lime_keras.synthesis.reduction import reduced

SIZE = 64


@pytest.fixture(scope="module")
def stored():
    rng, scenes = np.random.default_rng(0), []
    for index in range(3):
        mask = rng.uniform(0, 1, (SIZE, SIZE, 1)) * (rng.random((SIZE, SIZE, 1)) > 0.3)
        scene = example(index, size=SIZE) | {"mask": mask, "mirror": 1 + mask}
        scenes.append(camera.photograph(records.parse(records.encode(scene)), tf.constant([1, 2])))
    return scenes


@pytest.mark.parametrize("size", [64, 32, 16, 1])
def test_a_batch_is_reduced_as_stored_scenes_are(stored, size):
    names = pipeline._CHANNELS.keys() | {"camera", "diffuse_albedo", "ambient"}
    batch = {name: tf.stack([scene[name] for scene in stored]) for name in names}
    found = reduced(batch, size)
    assert set(found) == names
    for name in names:
        expected = [pipeline.resize(scene, size)[name] for scene in stored]
        np.testing.assert_allclose(found[name], expected, rtol=2e-5, atol=2e-6, err_msg=name)


def test_only_what_is_there_is_reduced(stored):
    batch = {name: stored[0][name][None] for name in ("mask", "mirror", "specular_albedo")}
    assert set(reduced(batch, 16)) == set(batch)


def test_an_empty_mask_stays_black():
    batch = {
        "mask": np.zeros((2, 8, 8, 1), np.float32),
        "mirror": np.ones((2, 8, 8, 1), np.float32),
    }
    batch["normal"] = np.zeros((2, 8, 8, 3), np.float32)
    for value in reduced(batch, 4).values():
        np.testing.assert_array_equal(value, 0)


def test_a_size_that_does_not_divide_is_refused():
    with pytest.raises(ValueError, match="8 pixels cannot be averaged to 3"):
        reduced({"mask": np.zeros((1, 8, 8, 1), np.float32)}, 3)
