"""Photos of known scenes: Eq. 4 under exposure, the sensor's statistics, the blur, the JPEG."""

import numpy as np
import pytest
import tensorflow as tf
from sphere_corpus import COMPOSED, composed, example

from lime_keras import losses
from lime_keras.data import camera, records
from lime_keras.optics import camera_law, colour
from lime_keras.optics.dynamic_range import compress

SIZE = 64
UNTOUCHED = ("mask", "normal", "camera", "diffuse_albedo", "specular_albedo", "shininess")


@pytest.fixture(scope="module")
def sphere():
    return records.parse(records.encode(example(0)))


@pytest.fixture
def perfect(monkeypatch):
    """A camera that only exposes and clips."""
    monkeypatch.setattr(camera_law, "CONFUSION", 0.0)
    monkeypatch.setattr(camera_law, "FULL_WELL", (1e12, 1e12))
    monkeypatch.setattr(camera_law, "NEVER_COMPRESSED", 1.0)
    for error in ("CAST", "TINT", "UNEVEN"):
        monkeypatch.setattr(camera_law, error, 0.0)


def photo(scene, seed):
    found = camera.photograph(scene, camera.radiance(scene), tf.constant([seed, 0]))
    return {name: value.numpy() for name, value in found.items()}


def exposure(found, scene):
    return float(found["ambient"] / scene["ambient"])


def flat(radiance, size=SIZE):
    """A scene without an object, of one radiance all over; a grey 8-bit level if below 1."""
    image = np.full((size, size, 3), colour.linear_to_srgb(min(radiance, 1.0)), np.float32)
    scene = example(0, size=size) | {"image": image, "mask": np.zeros((size, size, 1))}
    return records.parse(records.encode(scene))


# Exposure.


@pytest.mark.parametrize("seed", range(6))
def test_the_photo_is_eq_4_of_its_own_layers(sphere, perfect, seed):
    found = photo(sphere, seed)
    inside = sphere["mask"][..., 0] == 1
    radiance = composed(found)[inside]
    level = colour.linear_to_srgb(np.minimum(radiance, 1))
    # Half a level of the stored image, up to half a stop brighter, and half one of the photo.
    np.testing.assert_allclose(found["image"][inside], level, atol=1.3 / 255)
    threshold = colour.srgb_to_linear(colour.CLIPPED)
    sure = np.abs(radiance - threshold) > 0.01
    np.testing.assert_array_equal(
        found["clipped"][inside][sure], (radiance >= threshold)[sure].astype(np.float32)
    )


def test_a_darker_exposure_shows_what_was_clipped(sphere, perfect):
    darkest = min((photo(sphere, seed) for seed in range(8)), key=lambda p: p["ambient"])
    assert exposure(darkest, sphere) < 0.85
    clipped = (sphere["image"].numpy() >= 1) & (sphere["mask"].numpy() == 1)
    recovered = clipped & (darkest["clipped"] == 0)
    assert recovered.sum() > 10
    assert np.ptp(darkest["image"][recovered]) > 0.01


def test_the_light_is_scaled_and_nothing_else(sphere, perfect):
    found = photo(sphere, 1)
    factor = exposure(found, sphere)
    assert abs(factor - 1) > 0.01
    for name in ("diffuse_shading", "specular_shading", "mirror", "environment"):
        np.testing.assert_allclose(found[name], sphere[name] * factor, rtol=1e-5)
    for name in (*UNTOUCHED, "shape", "light", "seed", "index"):
        np.testing.assert_array_equal(found[name], sphere[name])


def test_the_background_is_exposed_and_clipped(sphere, perfect):
    found = photo(sphere, 2)
    outside = sphere["mask"][..., 0] == 0
    linear = colour.srgb_to_linear(sphere["image"].numpy()[outside]) * exposure(found, sphere)
    level = colour.linear_to_srgb(np.minimum(linear, 1))
    np.testing.assert_allclose(found["image"][outside], level, atol=0.51 / 255)


def test_a_silhouette_keeps_the_objects_share_of_a_highlight(perfect):
    """Where the stored pixel was clipped, its part of the object's radiance is a lower bound."""
    scene = example(0, size=8)
    highlight = np.full((8, 8, 1), 40.0)
    scene |= {
        "image": np.ones((8, 8, 3)),
        "mask": np.full((8, 8, 1), 128 / 255),
        "specular_shading": highlight,
        "specular_albedo": 1.0,
    }
    found = photo(records.parse(records.encode(scene)), 0)
    assert found["image"].min() == 1 and found["clipped"].min() == 1


def test_exposures_are_spread_evenly_within_half_a_stop():
    scene = flat(0.2, 8)
    stops = np.log2([exposure(photo(scene, seed), scene) for seed in range(200)])
    assert -0.5 <= stops.min() < -0.45 and 0.45 < stops.max() <= 0.5
    counts, _ = np.histogram(stops, 4, (-0.5, 0.5))
    assert counts.min() > 30


def test_the_truth_costs_little_in_a_photo():
    """Eq. 5 of the true layers costs what noise and JPEG do; an exposure left out costs 0.1."""
    costs = []
    for index in range(6):
        found = photo(records.parse(records.encode(example(index))), index)
        batch = {name: tf.constant(value)[None] for name, value in found.items()}
        layers, specular = [batch[name] for name in COMPOSED], compress(batch["specular_shading"])
        costs.append(losses.compositing_l1(*layers, specular, batch["clipped"])[0])
    assert max(costs) < 0.05 and np.mean(costs) < 0.03


# The sensor.


def sensed(radiance, full_well, size=256):
    light = tf.fill((size, size, 3), np.float32(radiance))
    levels = camera._sensed(light, tf.constant(full_well), tf.constant([3, 4])).numpy()
    assert levels.dtype == np.uint8
    return colour.srgb_to_linear(levels / 255.0)


@pytest.mark.parametrize("full_well", [1e3, 5e3, 3e4])
@pytest.mark.parametrize("radiance", [0.05, 0.2, 0.5, 0.8])
def test_noise_has_the_mean_and_variance_of_electrons(radiance, full_well):
    found = sensed(radiance, full_well)
    variance = (radiance + camera_law.READ_NOISE**2 / full_well) / full_well
    # Rounding to 8 bits adds a twelfth of a level's square.
    level = np.ptp(colour.srgb_to_linear(colour.linear_to_srgb(radiance) + np.array([-1, 1]) / 510))
    assert found.mean() == pytest.approx(radiance, rel=3e-3)
    assert found.var() == pytest.approx(variance + level**2 / 12, rel=0.06)


def test_noise_is_white():
    noise = sensed(0.5, 5e3) - 0.5
    noise /= noise.std()
    for shift in ((0, 1), (1, 0), (1, 1), (0, 21)):
        moved = np.roll(noise, shift, (0, 1))
        assert abs(np.mean(noise * moved)) < 0.015, shift
    assert abs(np.mean(noise[..., 0] * noise[..., 1])) < 0.015
    assert abs(np.mean(noise**3)) < 0.1 and np.mean(noise**4) == pytest.approx(3, abs=0.15)


@pytest.mark.parametrize("full_well", [1e3, 3e4])
@pytest.mark.parametrize("radiance, level", [(0.0, 0), (1.2, 1), (1e6, 1), (np.inf, 1)])
def test_the_sensor_clips_at_both_ends(radiance, level, full_well):
    found = sensed(radiance, full_well)
    assert np.isfinite(found).all()
    assert abs(np.median(found) - level) < 1e-6


def test_without_noise_every_level_comes_back():
    levels = np.arange(256, dtype=np.uint8)[:, None, None] * np.ones(3, np.uint8)
    light = colour.srgb_to_linear(levels / 255.0).astype(np.float32)
    found = camera._sensed(tf.constant(light), tf.constant(1e12), tf.constant([0, 0]))
    np.testing.assert_array_equal(found, levels)


# Defocus.


def point(size):
    light = np.zeros((size, size, 3), np.float32)
    light[size // 2, size // 3] = (1, 2, 300)
    return light


@pytest.mark.parametrize("size", [128, 256, 512])
@pytest.mark.parametrize("strength", [0.7, 1.0])
def test_defocus_spreads_a_point_over_a_disc(size, strength):
    blurred = camera._defocused(tf.constant(point(size)), tf.constant(strength)).numpy()
    radius = 1.5 * strength * size / 256
    across = np.arange(size) - size // 3
    down = np.arange(size) - size // 2
    disc = np.clip(radius + 0.5 - np.hypot(across, down[:, None]), 0, 1)[..., None]
    np.testing.assert_allclose(blurred, disc / disc.sum() * [1, 2, 300], rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(blurred.sum((0, 1)), [1, 2, 300], rtol=1e-5)


@pytest.mark.parametrize("strength", [0.0, 0.33])
def test_a_point_smaller_than_a_pixel_is_sharp(strength):
    light = point(256) + 0.25
    found = camera._defocused(tf.constant(light), tf.constant(strength))
    np.testing.assert_array_equal(found, light)


def test_defocus_does_not_darken_the_borders():
    light = tf.fill((256, 256, 3), 0.7)
    np.testing.assert_allclose(camera._defocused(light, tf.constant(1.0)), 0.7, rtol=1e-5)


# JPEG.


def test_lower_quality_keeps_less():
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    smooth = tf.image.resize(noise[::8, ::8].astype(np.float32), (64, 64)).numpy()
    levels = tf.constant(smooth.astype(np.uint8))

    def error(quality):
        found = camera._compressed(levels, tf.constant(quality)).numpy().astype(float)
        return np.abs(found - levels.numpy()).mean()

    assert 0 < error(98) < error(80) < error(60) < 6


def test_some_photos_never_were_a_jpeg(monkeypatch, sphere):
    compressed = []
    original = camera._compressed

    def counted(levels, quality):
        compressed.append(int(quality))
        return original(levels, quality)

    monkeypatch.setattr(camera, "_compressed", counted)
    for seed in range(60):
        photo(sphere, seed)
    assert 35 <= len(compressed) <= 56
    assert 60 <= min(compressed) < 66 and 92 < max(compressed) <= 98


# The whole.


def test_the_seed_decides_the_photo(sphere):
    first, again, other = (photo(sphere, seed) for seed in (5, 5, 6))
    for name, value in first.items():
        np.testing.assert_array_equal(again[name], value)
    assert not np.array_equal(other["image"], first["image"])
    assert exposure(other, sphere) != exposure(first, sphere)


def test_by_default_an_example_has_its_own_camera(sphere):
    light = camera.radiance(sphere)
    own = camera.photograph(sphere, light)
    seed = tf.stack([sphere["seed"], sphere["index"]])
    np.testing.assert_array_equal(own["image"], camera.photograph(sphere, light, seed)["image"])
    other = camera.photograph(sphere | {"index": tf.constant(7, tf.int64)}, light)
    assert not np.array_equal(own["image"], other["image"])


def test_a_graph_takes_the_same_photo(sphere):
    compiled = tf.function(camera.photograph)(sphere, camera.radiance(sphere), tf.constant([5, 0]))
    for name, value in photo(sphere, 5).items():
        if name == "image":
            np.testing.assert_allclose(compiled[name], value, atol=1e-6)
        elif compiled[name].dtype == tf.float32:
            np.testing.assert_allclose(compiled[name], value, rtol=1e-6)


def test_the_scene_alone_suffices(sphere):
    scene = {name: sphere[name] for name in camera.SCENE}
    found = photo(scene, 3)
    assert set(found) == {*camera.SCENE, "clipped", "cast"}
    np.testing.assert_array_equal(found["image"], photo(sphere, 3)["image"])


@pytest.mark.parametrize("size", [1, 8, 100])
def test_extreme_scenes_stay_finite(size):
    scene = example(0, size=size)
    scene |= {
        "image": np.ones((size, size, 3)),
        "mask": np.ones((size, size, 1)),
        "specular_shading": np.full((size, size, 1), records.LARGEST_HALF),
        "specular_albedo": 1.0,
    }
    found = photo(records.parse(records.encode(scene)), 0)
    assert np.isfinite(found["image"]).all() and found["clipped"].min() == 1
    levels = found["image"] * 255
    np.testing.assert_allclose(levels, np.round(levels), atol=1e-4)
    assert found["image"].min() >= 0 and found["image"].max() <= 1
