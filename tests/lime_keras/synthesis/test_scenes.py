"""Scenes of a small bank: against Eq. 4, sums over every texel, and one another."""

import keras
import numpy as np
import pytest

from lime_keras.data.features import LEARNT_FROM
from lime_keras.optics import colour, octahedral, shading, shininess
from lime_keras.optics.compositing import compose
from lime_keras.synthesis import lights, mixing
from lime_keras.synthesis.scenes import Scenes
from tests.fixtures import sphere_bank

SIZE = 32
FEATURES = (*LEARNT_FROM, "shininess", "normal", "camera", "environment", "seed", "index")


@pytest.fixture(scope="module")
def bank(tmp_path_factory):
    return sphere_bank.write(tmp_path_factory.mktemp("bank"), size=SIZE)


@pytest.fixture(scope="module")
def plain(bank):
    """Scenes as they are, without a camera."""
    return Scenes(bank, size=SIZE, camera=False, features=FEATURES)


def _numpy(batch):
    return {name: keras.ops.convert_to_numpy(value) for name, value in batch.items()}


@pytest.fixture(scope="module")
def made(plain):
    """The draws of eight scenes, and their batch."""
    drawn = plain.draw(3, np.arange(8))
    return drawn, _numpy(plain.make(drawn))


def test_a_batch_holds_what_was_asked_for_in_its_shapes(made):
    _, batch = made
    assert set(batch) == set(FEATURES)
    images = {"image": 3, "clipped": 3, "mask": 1, "normal": 3}
    images |= dict.fromkeys(("diffuse_shading", "specular_shading", "mirror"), 1)
    for name, channels in images.items():
        assert batch[name].shape == (8, SIZE, SIZE, channels), name
    assert batch["diffuse_albedo"].shape == (8, 3)
    assert batch["environment"].shape == (8, 64, 128, 1)
    for value in batch.values():
        assert np.isfinite(value).all()
    np.testing.assert_array_equal(batch["index"], np.arange(8))
    np.testing.assert_array_equal(batch["exponent_bin"], shininess.bin_of(batch["shininess"]))


def test_the_image_is_eq_4_inside_the_object(made):
    _, batch = made
    layers = ("diffuse_albedo", "specular_albedo", "ambient", "diffuse_shading", "specular_shading")
    linear = np.clip(compose(*(batch[name] for name in layers)), 0, 1)
    inside = batch["mask"][..., 0] == 1
    difference = np.abs(colour.linear_to_srgb(linear) - batch["image"])[inside]
    assert difference.max() < 0.51 / 255


def test_layers_are_sums_over_the_mixed_light(bank, made):
    drawn, batch = made
    radiance = mixing.mixed(np.load(bank / lights.RADIANCE).astype(np.float32), drawn["light"])
    one_surface = drawn["gbuffer"]["share"] == 255
    for scene in range(4):
        inside = (batch["mask"][scene, ..., 0] == 1) & one_surface[scene]
        rotation = drawn["light"].rotation[scene].astype(float)
        normal = octahedral.decode(drawn["gbuffer"]["normal"][scene, 0])[inside] @ rotation
        view = shading.view_directions(batch["camera"][scene], SIZE, SIZE)[inside] @ rotation
        texels = shading.texels(radiance[scene])
        found = batch["diffuse_shading"][scene, ..., 0][inside]
        expected = shading.diffuse(normal, *texels)
        assert np.median(np.abs(found / expected - 1)) < 0.01
        found = batch["specular_shading"][scene, ..., 0][inside]
        expected = shading.specular(normal, view, float(batch["shininess"][scene]), *texels)
        assert np.median(np.abs(found / expected - 1)) < 0.04


def test_the_light_that_is_told_is_the_light_that_shines(made):
    """D of the first surface from `environment`, in camera space, is the layer D."""
    drawn, batch = made
    for scene in range(4):
        inside = (batch["mask"][scene, ..., 0] == 1) & (drawn["gbuffer"]["share"][scene] == 255)
        texels = shading.texels(batch["environment"][scene, ..., 0].astype(float))
        expected = shading.diffuse(batch["normal"][scene][inside].astype(float), *texels)
        found = batch["diffuse_shading"][scene, ..., 0][inside]
        assert np.median(np.abs(found / expected - 1)) < 0.02


def test_a_scene_follows_from_seed_and_position_alone(plain, made):
    """Also if the batch begins elsewhere."""
    _, batch = made
    later = _numpy(plain.make(plain.draw(3, np.arange(2, 10))))
    for name, value in later.items():
        np.testing.assert_allclose(value[:6], batch[name][2:], rtol=1e-4, atol=1e-5, err_msg=name)
    other = plain.draw(4, np.arange(8))
    assert not np.array_equal(other["draws"]["shininess"], batch["shininess"])


def test_training_and_held_out_scenes_share_no_shape_and_no_map(bank):
    seen = Scenes(bank, size=SIZE, camera=False, features=FEATURES)
    held = Scenes(bank, size=SIZE, camera=False, features=FEATURES, held_out=True)
    one, two = (scenes.draw(0, np.arange(200))["light"].maps for scenes in (seen, held))
    assert not set(one.ravel()) & set(two.ravel())
    assert set(seen.shapes).isdisjoint(held.shapes) and held.shapes and seen.shapes
    assert {*seen.shapes, *held.shapes} == {f"ellipsoid-{k}" for k in range(12)}


@pytest.mark.slow
def test_photographed_and_reduced_scenes_are_the_same_scenes(bank, made):
    """A camera scales the light and nothing of the material; smaller images are means."""
    _, batch = made
    small = Scenes(bank, size=SIZE // 2, camera=True, features=FEATURES)
    photo = _numpy(small.make(small.draw(3, np.arange(8))))
    for name in ("diffuse_albedo", "specular_albedo", "shininess", "exponent_bin"):
        np.testing.assert_allclose(photo[name], batch[name])
    blocks = batch["mask"].reshape(8, SIZE // 2, 2, SIZE // 2, 2, 1)
    np.testing.assert_allclose(photo["mask"], blocks.mean(axis=(2, 4)), atol=1e-6)
    exposure = photo["ambient"] / batch["ambient"]
    np.testing.assert_array_less(np.abs(np.log2(exposure)), 0.51)
    np.testing.assert_allclose(
        photo["environment"], batch["environment"] * exposure[:, None, None, None], rtol=1e-4
    )
    assert photo["image"].shape == (8, SIZE // 2, SIZE // 2, 3)
    np.testing.assert_allclose(photo["camera"], batch["camera"] / 2)


def test_images_that_do_not_fit_are_refused(bank):
    with pytest.raises(ValueError, match="cannot be averaged to 24"):
        Scenes(bank, size=24, camera=False, features=FEATURES)


def test_a_bank_of_one_light_is_refused(tmp_path):
    sphere_bank.write(tmp_path, size=SIZE, maps=1)
    with pytest.raises(ValueError, match="light maps: there is 1"):
        Scenes(tmp_path, size=SIZE, camera=False, features=FEATURES)


@pytest.mark.slow
def test_a_scene_names_its_shape_and_the_map_that_gives_most_light(bank):
    scenes = Scenes(bank, size=SIZE, camera=False, features=(*FEATURES, "shape", "light"))
    drawn = scenes.draw(3, np.arange(8))
    batch = scenes.make(drawn)
    assert set(batch["shape"]) <= set(scenes.shapes) and set(batch["light"]) <= set(scenes.lights)
    held = lights.LightBank(bank)
    for name, maps, weights in zip(
        batch["light"], drawn["light"].maps, drawn["light"].weights, strict=True
    ):
        power = weights / held.scale[maps]
        assert power[[held.names[number] for number in maps].index(name)] == power.max()
