"""Skies: where the sun is, what power it has, what the ground gives back."""

import math

import mitsuba as mi
import numpy as np
import pytest

from lime_keras.optics import environment
from lime_keras.render.scene import skies

HEIGHT = 64
TOWARDS = environment.directions(HEIGHT, 2 * HEIGHT)
ANGLES = environment.solid_angles(HEIGHT, 2 * HEIGHT)


@pytest.fixture(autouse=True)
def active(mitsuba_choice):
    """Mitsuba's variant is set."""


@pytest.mark.parametrize("azimuth", [-2.0, 0.0, 1.0, 3.1])
@pytest.mark.parametrize("elevation", [0.1, 0.7, 1.5])
def test_the_sun_is_where_it_was_put(elevation, azimuth):
    found = skies.sky(elevation, azimuth, 3.0, 0.2, HEIGHT)
    brightest = TOWARDS[np.unravel_index(np.argmax(found), found.shape)]
    sun = [
        math.cos(elevation) * math.sin(azimuth),
        math.sin(elevation),
        -math.cos(elevation) * math.cos(azimuth),
    ]
    assert np.degrees(np.arccos(np.clip(brightest @ sun, -1, 1))) < 2 * 180 / HEIGHT


def without_the_sun(monkeypatch, *sky):
    with monkeypatch.context() as patch:
        patch.setattr(skies, "_disc", lambda sun: (sun[None], np.zeros(1)))
        return skies.sky(*sky)


def power(radiance):
    return np.sum(radiance * ANGLES * (TOWARDS[..., 1] > 0))


def test_the_sun_keeps_its_power_at_any_size_of_texels(monkeypatch):
    """Its disc is smaller than a texel: the power is that of the model, integrated finely."""
    sky = (0.6, 0.4, 2.5, 0.1)
    powers = []
    for height in (HEIGHT, 2 * HEIGHT):
        angles = environment.solid_angles(height, 2 * height)
        disc = skies.sky(*sky, height) - without_the_sun(monkeypatch, *sky, height)
        powers.append(np.sum(disc[: height // 2] * angles[: height // 2], dtype=float))
    monkeypatch.setattr(skies, "_RINGS", 300)
    monkeypatch.setattr(skies, "_SECTORS", 300)
    direction, weight = skies._disc(np.array([0.0, math.sin(0.6), -math.cos(0.6)]))
    reference = np.sum(
        skies._luminance(np.array([0.0, math.sin(0.6), -math.cos(0.6)]), 2.5, 0.1, "sun", direction)
        * weight
    )
    np.testing.assert_allclose(powers, reference, rtol=2e-3)


def test_the_suns_disc_has_its_solid_angle():
    direction, weight = skies._disc(np.array([0.0, 1.0, 0.0]))
    cap = 2 * math.pi * (1 - math.cos(math.radians(0.5358 / 2)))
    assert weight.sum() == pytest.approx(cap, rel=1e-3)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, atol=1e-12)


def test_of_a_setting_sun_the_upper_half_shines():
    direction, weight = skies._disc(np.array([1.0, 0.0, 0.0]))
    assert (direction[:, 1] > 0).all()
    assert weight.sum() == pytest.approx(skies._disc(np.array([0, 1.0, 0]))[1].sum() / 2, rel=0.02)
    assert np.isfinite(skies.sky(0.0, 0.0, 3.0, 0.2, HEIGHT)).all()


@pytest.mark.parametrize("albedo", [0.0, 0.5])
def test_the_ground_gives_back_its_share_of_what_reaches_it(albedo):
    found = skies.sky(0.8, 0.0, 3.0, albedo, HEIGHT)
    above, below = found[: HEIGHT // 2], found[HEIGHT // 2 :]
    up = TOWARDS[: HEIGHT // 2, :, 1]
    irradiance = np.sum(above * ANGLES[: HEIGHT // 2] * up, dtype=float)
    np.testing.assert_allclose(below, albedo * irradiance / math.pi, rtol=1e-5)


def test_haze_takes_from_the_sun_and_gives_to_the_sky(monkeypatch):
    clear, hazy = ((0.5, 0.0, turbidity, 0.2, HEIGHT) for turbidity in (1.5, 9.0))
    skies_alone = [power(without_the_sun(monkeypatch, *sky)) for sky in (clear, hazy)]
    suns = [
        power(skies.sky(*s)) - alone for s, alone in zip((clear, hazy), skies_alone, strict=True)
    ]
    assert suns[1] < 0.7 * suns[0] and skies_alone[1] > skies_alone[0]


def test_a_drawn_sky_is_light_and_follows_from_its_seed():
    drawn = [skies.sample(np.random.default_rng(seed), HEIGHT) for seed in (0, 0, 1)]
    for sky in drawn:
        assert sky.shape == (HEIGHT, 2 * HEIGHT) and sky.dtype == np.float32
        assert np.isfinite(sky).all() and sky.min() >= 0 and sky[:4].min() > 0
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert (drawn[0] != drawn[2]).any()


def test_the_slow_variant_sees_the_same_sky():
    """Where there is no libLLVM."""
    fast = skies.sky(0.5, 1.0, 4.0, 0.3, 16)
    variant = mi.variant()
    mi.set_variant("scalar_rgb")
    try:
        slow = skies.sky(0.5, 1.0, 4.0, 0.3, 16)
    finally:
        mi.set_variant(variant)
    np.testing.assert_allclose(slow, fast, rtol=2e-3)
