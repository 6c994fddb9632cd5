"""Backgrounds against slow references in NumPy."""

import numpy as np
import pytest
from scipy import ndimage

from lime_keras.optics import colour, environment
from lime_keras.optics.shading import view_directions
from lime_keras.synthesis import backdrop, panorama, scene_draws

SIZE = 32
TEXTURES = np.random.default_rng(9).integers(0, 256, (5, 40, 40, 3), dtype=np.uint8)


def draws(count=4, seed=0, **changes):
    plain = {"blend": np.full((scene_draws.LATTICE,) * 2, -1e3), "tint": np.ones((2, 3))}
    plain |= {"surrounded": 0} | changes
    drawn = scene_draws.batched(
        [
            scene_draws.draw(np.random.default_rng([seed, k]), SIZE, TEXTURES.shape)
            for k in range(count)
        ]
    )
    for name, value in plain.items():
        drawn[name] = np.broadcast_to(value, drawn[name].shape).astype(drawn[name].dtype)
    return drawn


def backgrounds(drawn, light=None, rotation=None, camera=None):
    count = len(drawn["tint"])
    light = np.zeros((count, 8, 16), np.float32) if light is None else light
    rotation = np.eye(3)[None] if rotation is None else rotation
    camera = [100.0, 100, 16, 16] if camera is None else camera
    found = backdrop.background(
        TEXTURES,
        light,
        np.broadcast_to(rotation, (count, 3, 3)).astype(np.float32),
        np.broadcast_to(camera, (count, 4)).astype(np.float32),
        SIZE,
        drawn,
    )
    return np.array(found)


def crop(drawn, scene, part=0):
    row, column = drawn["corner"][scene, part]
    image = TEXTURES[drawn["texture"][scene, part]][row : row + SIZE, column : column + SIZE]
    turn = drawn["texture_turn"][scene, part]
    image = image.swapaxes(0, 1) if turn & 4 else image
    image = image[:, ::-1] if turn & 1 else image
    return image[::-1] if turn & 2 else image


# Backgrounds.


def test_a_background_is_a_turned_crop_of_a_texture():
    drawn = draws(24)
    for scene, found in enumerate(backgrounds(drawn)):
        expected = colour.srgb_to_linear(crop(drawn, scene) / 255)
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7)
    assert len(np.unique(drawn["texture_turn"][:, 0])) == 8


def test_gains_and_tints_scale_linear_radiance_up_to_white():
    gains = np.array([[0.5, 1.2, 3.0], [1, 1, 1]])
    drawn = draws(2)
    found = backgrounds(draws(2, tint=gains))
    np.testing.assert_allclose(found, np.minimum(backgrounds(drawn) * gains[0], 1), rtol=1e-5)
    assert found.max() == 1


def test_a_field_blends_two_textures_smoothly():
    drawn = draws(1)
    first, second = (colour.srgb_to_linear(crop(drawn, 0, part) / 255) for part in (0, 1))
    np.testing.assert_allclose(backgrounds(draws(1, blend=1e3))[0], second, rtol=1e-5, atol=1e-7)
    halves = np.repeat([-20.0, 20.0], scene_draws.LATTICE // 2)
    found = backgrounds(draws(1, blend=halves))[0]
    np.testing.assert_allclose(found[:, :10], first[:, :10], atol=1e-3)
    np.testing.assert_allclose(found[:, -10:], second[:, -10:], atol=1e-3)
    level = backgrounds(draws(1, blend=np.log(3)))[0]
    np.testing.assert_allclose(level, first + 0.75 * (second - first), rtol=1e-4, atol=1e-6)


def smooth_map(rows):
    towards = environment.directions(rows, 2 * rows)
    return (0.4 + 0.3 * towards @ [0.5, 0.6, -0.62]).astype(np.float32)


def rotation(seed):
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return turn * np.linalg.det(turn)


@pytest.mark.parametrize("rows", [64, 256])
@pytest.mark.parametrize("sharpness", [0, 1])
def test_surroundings_are_what_the_cameras_rays_see(rows, sharpness):
    camera = np.array([60.0, 50.0, 20.0, 11.0])  # a wide view, its middle beside the crop's
    light, turn = smooth_map(rows), rotation(2)
    drawn = draws(2, surrounded=1, sharpness=sharpness)
    found = backgrounds(drawn, light[None].repeat(2, axis=0), turn, camera)
    rays = -view_directions(camera, SIZE, SIZE) @ turn  # the transpose takes them to the map
    expected = environment.lookup(light, rays)[..., None].repeat(3, axis=-1)
    np.testing.assert_allclose(found[1], expected, atol=0.01)


def test_huge_surroundings_are_white_beside_a_texture():
    drawn = draws(1, surrounded=1, blend=np.repeat([-40.0, 40.0], scene_draws.LATTICE // 2))
    found = backgrounds(drawn, np.full((1, 16, 32), 1e30, np.float32))[0]
    np.testing.assert_array_equal(found[:, :8], 1)
    second = colour.srgb_to_linear(crop(drawn, 0, 1) / 255)
    np.testing.assert_allclose(found[:, -8:], second[:, -8:], atol=1e-5)


def test_sharper_surroundings_show_more():
    light = np.random.default_rng(0).uniform(0, 1, (1, 256, 512)).astype(np.float32)
    spread = [
        backgrounds(draws(1, surrounded=1, sharpness=sharpness), light).std()
        for sharpness in (0, 0.5, 1)
    ]
    assert 0 < spread[0] < 0.7 * spread[1] < 0.7 * spread[2]


def test_longitude_wraps_and_poles_end():
    rng = np.random.default_rng(0)
    light = rng.uniform(size=(2, 8, 16)).astype(np.float32)
    direction = rng.normal(size=(2, 5, 7, 3))
    direction[:, 0] *= (1e-3, 1, 1e-3)  # at the poles
    direction[:, 1, :, 0] *= 1e-3  # at the seam
    x, y, z = np.moveaxis(direction, -1, 0)
    u = np.arctan2(x, -z) / (2 * np.pi)
    v = np.arctan2(np.hypot(x, z), y) / np.pi
    found = panorama.looked_up(light, u.astype(np.float32), v.astype(np.float32))
    for one, towards, seen in zip(light, direction, found, strict=True):
        np.testing.assert_allclose(seen, environment.lookup(one, towards), atol=1e-5)


# Objects before backgrounds.


def objects(count=4):
    rng = np.random.default_rng(1)
    shape = (count, SIZE, SIZE)
    coverage = ndimage.gaussian_filter(rng.normal(size=(*shape, 1)), (0, 4, 4, 0)) > 0
    coverage = np.clip(ndimage.uniform_filter(coverage * 1.0, (0, 2, 2, 0)), 0, 1)
    radiance = rng.uniform(0, 3, (*shape, 3))
    behind = rng.uniform(0, 1, (*shape, 3))
    return tuple(x.astype(np.float32) for x in (radiance, coverage, behind))


def test_an_object_stands_before_its_background():
    radiance, coverage, behind = objects(3)
    expected = coverage * radiance + (1 - coverage) * behind
    alone = np.array(backdrop.compose(radiance, coverage, behind))
    np.testing.assert_allclose(alone, expected, rtol=1e-6)
