"""Scenes in a mirror: still scenes, of the same material."""

import numpy as np
import pytest
import tensorflow as tf
from sphere_corpus import example

from lime_keras.data import records
from lime_keras.data.mirrored import flip
from lime_keras.optics import camera_law, shading

SIZE = 12


def scene(seed=0):
    """Normals, a camera off the picture's middle, and a light that nothing makes symmetric."""
    rng = np.random.default_rng(seed)
    normal = rng.normal([0.4, 0.2, 3.0], size=(SIZE * SIZE, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    out = {
        "mask": np.ones((SIZE, SIZE, 1)),
        "normal": normal.reshape(SIZE, SIZE, 3),
        "environment": rng.exponential(size=(16, 32, 1)) ** 2,
        "camera": np.array([30.0, 32.0, 4.5, 7.0]),
        "shininess": 40.0,
    }
    return out | shaded(out)


def shaded(scene):
    """D, S and M as Eqs. 1 to 3 give them of the scene's normals, camera and light."""
    normal = np.asarray(scene["normal"], np.float64).reshape(-1, 3)
    view = shading.view_directions(np.asarray(scene["camera"]), SIZE, SIZE).reshape(-1, 3)
    light = np.asarray(scene["environment"], np.float64)[..., 0]
    layers = {
        "diffuse_shading": shading.diffuse(normal, *shading.texels(light)),
        "specular_shading": shading.specular(
            normal, view, float(scene["shininess"]), *shading.texels(light)
        ),
        "mirror": shading.mirror(normal, view, light),
    }
    return {name: values.reshape(SIZE, SIZE, 1) for name, values in layers.items()}


def as_tensors(scene):
    return {name: tf.constant(value, tf.float32) for name, value in scene.items()}


@pytest.mark.parametrize("seed", range(3))
def test_a_flipped_scene_is_shaded_as_its_flipped_picture(seed):
    flipped = flip(as_tensors(scene(seed)))
    for name, expected in shaded(flipped).items():
        np.testing.assert_allclose(flipped[name], expected, rtol=2e-4, atol=1e-5, err_msg=name)
        assert not np.allclose(flipped[name][:, ::-1], expected, rtol=1e-2), name


def test_twice_is_not_at_all():
    parsed = records.parse(records.encode(example(3, size=16)))
    again = flip(flip(parsed))
    assert set(again) == set(parsed)
    for name, value in parsed.items():
        np.testing.assert_array_equal(again[name], value, err_msg=name)


def test_material_and_names_stay():
    parsed = records.parse(records.encode(example(3, size=16)))
    flipped = flip(parsed)
    for name in ("diffuse_albedo", "specular_albedo", "shininess", "ambient", "index", "light"):
        assert np.array_equal(flipped[name], parsed[name])
    np.testing.assert_array_equal(flipped["image"], parsed["image"][:, ::-1])


def test_some_of_a_scene_is_enough():
    some = as_tensors({"mask": np.eye(4)[..., None]})
    assert list(flip(some)) == ["mask"]
    np.testing.assert_array_equal(flip(some)["mask"][..., 0], np.eye(4)[:, ::-1])


def test_an_uneven_cast_is_mirrored():
    cast, places = np.float32([0.1, -0.03, 0.07, 0.05]), camera_law.places(SIZE)
    flipped = flip({"cast": tf.constant(cast)})["cast"].numpy()
    gains, mirrored = (camera_law.balance(one[None], places) for one in (cast, flipped))
    np.testing.assert_allclose(mirrored, gains[:, :, ::-1], rtol=1e-6)
    assert np.abs(mirrored - gains).max() > 0.01
