"""Scenes in a mirror: still scenes, of the same material."""

import numpy as np
import pytest

from lime_keras.optics import camera_law, environment, shading
from lime_keras.train.photos.flips import flip
from lime_keras.train.photos.kept import INPUT_MASK, PREDICTED

SIZE = 12
BOTH = np.array([True])


def flipped_copy(batch, which):
    out = {name: value.copy() for name, value in batch.items()}
    flip(out, which)
    return out


def scene(seed=0):
    """Normals, a camera in the picture's middle, and a light that nothing makes symmetric."""
    rng = np.random.default_rng(seed)
    normal = rng.normal([0.4, 0.2, 3.0], size=(SIZE * SIZE, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    out = {
        "mask": np.ones((SIZE, SIZE, 1)),
        "normal": normal.reshape(SIZE, SIZE, 3),
        "environment": rng.exponential(size=(16, 32, 1)) ** 2,
        "camera": np.array([30.0, 32.0, SIZE / 2, 7.0]),
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
        "mirror": environment.lookup(light, shading.reflect(normal, view)),
    }
    return {name: values.reshape(SIZE, SIZE, 1) for name, values in layers.items()}


@pytest.mark.parametrize("seed", range(3))
def test_a_flipped_scene_is_shaded_as_its_flipped_picture(seed):
    one = scene(seed)
    batch = {name: np.asarray(one[name])[None] for name in one if name not in ("camera", "normal")}
    flipped = {name: value[0] for name, value in flipped_copy(batch, BOTH).items()}
    normal = one["normal"][:, ::-1] * [-1, 1, 1]
    for name, expected in shaded(one | flipped | {"normal": normal}).items():
        np.testing.assert_allclose(flipped[name], expected, rtol=2e-4, atol=1e-5, err_msg=name)
        assert not np.allclose(flipped[name][:, ::-1], expected, rtol=1e-2), name


def test_only_the_chosen_examples_are_flipped_and_twice_is_not_at_all():
    rng = np.random.default_rng(0)
    names = ("image", "clipped", "painted", "mask", INPUT_MASK, f"{PREDICTED}specular_shading")
    batch = {name: rng.uniform(size=(3, 4, 5, 2)) for name in names}
    batch |= {"cast": rng.uniform(size=(3, 4)), "diffuse_albedo": rng.uniform(size=(3, 3))}
    which = np.array([False, True, False])
    flipped = flipped_copy(batch, which)
    for name, value in batch.items():
        np.testing.assert_array_equal(flipped[name][~which], value[~which])
        changed = not np.array_equal(flipped[name][1], value[1])
        assert changed == (name != "diffuse_albedo"), name
        np.testing.assert_array_equal(flipped_copy(flipped, which)[name], value)


def test_an_uneven_cast_is_mirrored():
    cast, places = np.float32([[0.1, -0.03, 0.07, 0.05]]), camera_law.places(SIZE)
    flipped = flipped_copy({"cast": cast}, BOTH)["cast"]
    gains, mirrored = (camera_law.balance(one, places) for one in (cast, flipped))
    np.testing.assert_allclose(mirrored, gains[:, :, ::-1], rtol=1e-6)
    assert np.abs(mirrored - gains).max() > 0.01


def test_an_image_of_which_it_is_not_known_how_it_flips_is_refused():
    flip({"image": np.zeros((1, 4, 4, 3)), "seed": np.zeros(1)}, BOTH)
    with pytest.raises(ValueError, match=r"tangent may have a left and a right: say in .*flips"):
        flip({"tangent": np.zeros((1, 4, 4, 3))}, BOTH)
