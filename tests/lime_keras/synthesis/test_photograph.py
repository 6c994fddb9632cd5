"""Photos against those of `lime_keras.data.camera`, the sensor's statistics, the extremes."""

import functools

import numpy as np
import photo_scenes
import pytest
import tensorflow as tf
from photo_scenes import SIZE
from sphere_corpus import example

from lime_keras.data import camera, records
from lime_keras.optics import camera_law, colour
from lime_keras.synthesis import photograph as photographs
from lime_keras.synthesis.photograph import photograph

LARGE = 1e30


@functools.cache
def compiled():
    return tf.function(photo_scenes.photographed, jit_compile=True)


def taken(arrays):
    return {name: value.numpy() for name, value in compiled()(arrays).items()}


@pytest.fixture(scope="module")
def arrays():
    return photo_scenes.scenes()


@pytest.fixture(scope="module")
def photos(arrays):
    return taken(arrays)


def drawn(seed, size):
    """What `camera.photograph` draws for a seed, as draws of one scene."""
    seeds = tf.random.split(seed)
    stops, defocus, well, quality, kept = tf.random.stateless_uniform((5,), seeds[0]).numpy()
    shape = [-(-size * size * 3 // camera_law.GRAIN_LENGTH)]
    grain = tf.random.stateless_uniform(shape, seeds[1], 0, camera_law.GRAIN_ROWS, tf.int32)
    draws = {
        "exposure": camera_law.exposure(stops),
        "defocus": defocus,
        "full_well": camera_law.full_well(well),
        "quality": np.round(camera_law.quality(quality)),
        "compressed": float(kept >= camera_law.NEVER_COMPRESSED),
        "cast": camera_law.cast(
            tf.random.stateless_uniform((1, 4), tf.random.split(seed, 3)[2]).numpy()[0]
        ),
        "grain": grain.numpy(),
    }
    return {name: tf.constant(np.asarray(value)[None]) for name, value in draws.items()}


def still(count=1, size=SIZE, **changes):
    """Draws of a camera that does nothing but what is asked for."""
    rows = -(-size * size * 3 // camera_law.GRAIN_LENGTH)
    draws = {"exposure": 1, "defocus": 0, "full_well": 1e12, "quality": 98, "compressed": 0}
    out = {
        name: np.float32(value) if name == "cast" else np.broadcast_to(np.float32(value), count)
        for name, value in (draws | changes).items()
    }
    rng = np.random.default_rng(3)
    out.setdefault("cast", np.zeros((count, 4), np.float32))
    return out | {"grain": rng.integers(camera_law.GRAIN_ROWS, size=(count, rows), dtype=np.int32)}


# The same photo as of a stored scene.


@pytest.mark.parametrize("size", [SIZE, 128])
def test_with_the_same_draws_the_photo_is_that_of_a_stored_scene(size, monkeypatch):
    # The decoder of the one has a bias in red and blue that libjpeg's default has not.
    monkeypatch.setattr(camera_law, "NEVER_COMPRESSED", 1.0)
    for seed in range(4):
        stored = records.parse(records.encode(example(seed, size=size)))
        expected = camera.photograph(stored, tf.constant([seed, 0]))
        radiance = camera._radiance(stored, tf.constant(1.0))[None]
        batch = {name: value[None] for name, value in stored.items()}
        found = photograph(radiance, batch, drawn(tf.constant([seed, 0]), size))
        difference = (found["image"][0] - expected["image"]).numpy() * 255
        # The table from radiance to sRGB has steps of a tenth of a level, more where it is dark.
        assert np.abs(difference).max() <= 2 and np.abs(difference).mean() < 0.1
        assert np.mean(found["clipped"][0] != expected["clipped"]) < 1e-3
        for name in (*camera_law.LIT, "diffuse_albedo", "mask"):
            np.testing.assert_allclose(found[name][0], expected[name], rtol=1e-5)


def test_without_noise_the_photo_is_eq_4_to_a_level():
    light = np.random.default_rng(0).uniform(0, 1.4, (2, SIZE, SIZE, 3)).astype(np.float32)
    found = photograph(light, {}, still(2, exposure=[0.8, 1.2]))
    exposed = light * np.float32([0.8, 1.2])[:, None, None, None]
    expected = colour.linear_to_srgb(np.minimum(exposed, 1))
    np.testing.assert_allclose(found["image"], expected, atol=0.51 / 255)
    np.testing.assert_array_equal(found["clipped"], exposed >= camera_law.SATURATED)


def test_a_cast_multiplies_the_channels():
    cast = np.float32([[0.1, 0.0, 0.05, 0.0], [0.0, 0.03, 0.0, -0.05]])
    light = np.full((2, SIZE, SIZE, 3), 0.2, np.float32)
    found = photograph(light, {}, still(2, cast=cast))
    gains = camera_law.balance(cast, camera_law.places(SIZE))
    expected = colour.linear_to_srgb(light * gains)
    np.testing.assert_allclose(found["image"], expected, atol=0.51 / 255)
    np.testing.assert_allclose(np.log(gains).sum(-1), 0, atol=1e-6)
    warm = np.log(gains[..., 0] / gains[..., 2])
    np.testing.assert_allclose(warm[0].mean(), 0.1, atol=1e-6)
    assert warm[0, 0, -1] > warm[0, 0, 0] and warm[1, -1, 0] < warm[1, 0, 0]
    np.testing.assert_array_equal(found["cast"], cast)


def test_without_a_camera_light_is_clipped_and_rounded():
    light = np.random.default_rng(0).uniform(0, 1.4, (2, 6, 6, 3)).astype(np.float32)
    scene = {"mirror": np.float32(light[..., :1])}
    found = photograph(light, scene)
    expected = np.round(255 * colour.linear_to_srgb(np.minimum(light, 1))) / 255
    np.testing.assert_allclose(found["image"], expected, atol=1e-6)
    np.testing.assert_array_equal(found["clipped"], light >= camera_law.SATURATED)
    assert found["mirror"] is scene["mirror"]


@pytest.mark.parametrize("size", [128, 256, 512])
def test_defocus_is_that_of_a_stored_scene(size):
    light = np.zeros((3, size, size, 3), np.float32)
    light[:, size // 2, size // 3] = (1, 2, 300)
    light[:, 0, -1] = (5, 4, 3)
    strengths = np.float32([0.2, 0.6, 1.0])
    found = photographs._defocused(tf.constant(light), tf.constant(strengths))
    for strength, image, blurred in zip(strengths, light, found, strict=True):
        expected = camera._defocused(tf.constant(image), tf.constant(strength))
        np.testing.assert_allclose(blurred, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("full_well", [1e3, 3e4])
@pytest.mark.parametrize("radiance", [0.02, 0.2, 0.8])
def test_noise_has_the_mean_and_variance_of_electrons(radiance, full_well):
    size = 128
    light = np.full((2, size, size, 3), radiance, np.float32)
    draws = still(2, size, full_well=full_well)
    levels = photographs._sensed(light, draws["full_well"], draws["grain"]).numpy()
    found = colour.srgb_to_linear(levels / 255)
    variance = (radiance + camera_law.READ_NOISE**2 / full_well) / full_well
    level = np.ptp(colour.srgb_to_linear(colour.linear_to_srgb(radiance) + np.array([-1, 1]) / 510))
    for image in found:
        assert image.mean() == pytest.approx(radiance, rel=5e-3)
        assert image.var() == pytest.approx(variance + level**2 / 12, rel=0.08)
    first, other = found - found.mean()
    assert abs(np.mean(first * other)) < 0.05 * variance


def test_only_the_chosen_photos_are_compressed():
    light = np.random.default_rng(0).uniform(0, 1, (2, SIZE, SIZE, 3)).astype(np.float32)
    sharp = photograph(light, {}, still(2))["image"].numpy()
    found = photograph(light, {}, still(2, compressed=[0, 1], quality=60))["image"].numpy()
    np.testing.assert_array_equal(found[0], sharp[0])
    assert np.abs(found[1] - sharp[1]).mean() > 0.02


# Every scene by itself.


def test_a_photo_does_not_depend_on_the_rest_of_the_batch(arrays, photos):
    other = photo_scenes.scenes(seed=1)
    for name, value in arrays.items():
        if name != "textures":
            other[name] = np.concatenate([value[2:], other[name][2:]])
    other["textures"] = arrays["textures"]
    found = taken(other)
    for name, value in photos.items():
        np.testing.assert_array_equal(found[name][:2], value[2:])
        if name.endswith("image"):
            assert not np.array_equal(found[name][2:], value[:2])


def test_jax_takes_the_same_photos(photos, tmp_path):
    pytest.importorskip("jax")
    found = photo_scenes.photographed_by_jax(tmp_path)
    assert set(found) == set(photos)
    for name, value in photos.items():
        # Rounding decides some levels, and then some coefficients of the JPEG.
        assert np.mean(np.abs(found[name] - value)) < 0.1 / 255, name
        assert np.abs(found[name] - value).max() < 12 / 255, name


# The extremes.


@pytest.mark.parametrize("coverage", [0.0, 1.0])
@pytest.mark.parametrize("light", [0.0, 1e-30, LARGE])
@pytest.mark.parametrize("full_well", [1e3, 3e4])
def test_extreme_scenes_stay_finite(arrays, coverage, light, full_well):
    extreme = dict(arrays)
    for name in ("radiance", "light", "specular_shading"):
        extreme[name] = np.full_like(arrays[name], light)
    extreme["coverage"] = np.full_like(arrays["coverage"], coverage)
    extreme["draws/full_well"] = np.full_like(arrays["draws/full_well"], full_well)
    extreme["draws/compressed"] = np.array([0, 1, 0, 1], np.float32)
    found = taken(extreme)
    for name, value in found.items():
        assert np.isfinite(value).all(), name
    levels = found["image"] * 255
    np.testing.assert_allclose(levels, np.round(levels), atol=1e-4)
    assert found["image"].min() >= 0 and found["image"].max() <= 1
    if coverage and light == LARGE:
        assert found["image"].min() == 1 and found["clipped"].min() == 1
    if coverage and light < 1:
        assert found["image"].max() < 0.2 and found["clipped"].max() == 0


def test_sides_that_no_jpeg_has_are_refused():
    with pytest.raises(ValueError, match="multiples of 16"):
        photograph(np.zeros((1, 24, 24, 3), np.float32), {}, still(1, 24))
