"""Rendered rooms: analytic scenes, conventions, dynamic range, determinism."""

import mitsuba
import numpy as np
import pytest

from lime_keras.optics import environment
from lime_keras.render.rooms import panels, random_room, renderer


def empty_room(*lights, albedo=0.0, viewpoint=(0.0, 1.0, 0.0)):
    walls = [
        panels.Panel(p.corner, p.across, p.up, ((albedo,),))
        for p in random_room._walls(np.random.default_rng(0), np.array([4.0, 3.0, 5.0]))
    ]
    return random_room.Room((4.0, 3.0, 5.0), viewpoint, tuple(walls), (), lights)


def ball(centre, radius, radiance):
    return random_room.Light(radiance, solids=(panels.solid("sphere", centre, (radius,) * 3),))


@pytest.mark.parametrize(
    "direction",
    [(0, 0, -1), (1, 0, 0.3), (-1, 0.2, 0), (0.1, 0, 1), (0.3, 1, 0.1), (0.4, -1, 0.2), (1, 1, 1)],
)
def test_lamp_is_seen_where_it_hangs_with_its_energy(mitsuba_choice, direction):
    direction = np.array(direction) / np.linalg.norm(direction)
    room = empty_room(ball(np.array([0, 1, 0]) + 0.9 * direction, 0.05, 1000.0))
    radiance = renderer.render(room, height=64, samples=64, seed=0).astype(float)
    weighted = radiance * environment.solid_angles(64, 128)
    centroid = (environment.directions(64, 128) * weighted[..., None]).sum((0, 1))
    np.testing.assert_allclose(centroid / np.linalg.norm(centroid), direction, atol=0.02)
    solid_angle = 2 * np.pi * (1 - np.sqrt(1 - (0.05 / 0.9) ** 2))
    np.testing.assert_allclose(weighted.sum(), 1000 * solid_angle, rtol=0.1)


def test_inside_a_uniform_light_everything_is_its_radiance(mitsuba_choice):
    room = empty_room(*(random_room.Light(2.5, panels=(wall,)) for wall in empty_room().panels))
    room = random_room.Room(room.size, room.viewpoint, (), (), room.lights)
    np.testing.assert_allclose(renderer.render(room, height=32, samples=4, seed=0), 2.5, rtol=1e-5)


def test_direct_light_on_the_floor_agrees_with_the_inverse_square_law(mitsuba_choice, monkeypatch):
    room = empty_room(ball((0, 2.5, 0), 0.1, 100.0), albedo=0.5, viewpoint=(0.0, 1.0, 0.3))
    monkeypatch.setattr(renderer, "BOUNCES", 2)  # one reflection
    renderer._scene.cache_clear()
    radiance = renderer.render(room, height=64, samples=256, seed=0)
    renderer._scene.cache_clear()
    below = np.array([0, 0, 0.3])
    lamp = np.array([0, 2.5, 0]) - below
    irradiance = 100 * np.pi * 0.1**2 / (lamp @ lamp) * lamp[1] / np.linalg.norm(lamp)
    np.testing.assert_allclose(radiance[-2:].mean(), 0.5 / np.pi * irradiance, rtol=0.06)


def test_same_seed_same_map_and_zero_is_a_seed(mitsuba_choice):
    room = random_room.sample(np.random.default_rng(3))
    maps = [renderer.render(room, height=32, samples=4, seed=seed) for seed in (0, 0, 1)]
    np.testing.assert_allclose(maps[0], maps[1], rtol=1e-4, atol=1e-6)
    assert not np.allclose(maps[0], maps[2], rtol=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_rooms_have_the_range_of_photographed_light(mitsuba_choice, seed):
    room = random_room.sample(np.random.default_rng(seed))
    radiance = renderer.render(room, height=64, samples=8, seed=seed)
    assert radiance.shape == (64, 128) and radiance.dtype == np.float32
    assert np.isfinite(radiance).all() and radiance.min() >= 0
    assert 5 < radiance.max() / radiance.mean() < 20000
    assert np.median(radiance) > 0


def test_rooms_do_not_leak_into_one_another(mitsuba_choice):
    bright = empty_room(ball((1, 2, 1), 0.2, 1000.0), albedo=0.8)
    assert renderer.render(bright, height=16, samples=4, seed=0).max() > 1
    dark = empty_room(random_room.Light(0.0), albedo=0.8)
    assert renderer.render(dark, height=16, samples=4, seed=0).max() == 0


def test_the_slow_variant_sees_the_same_room(mitsuba_choice):
    room = random_room.sample(np.random.default_rng(3))
    fast = renderer.render(room, height=32, samples=64, seed=0)
    mitsuba.set_variant("scalar_rgb")
    try:
        slow = renderer.render(room, height=32, samples=32, seed=0)
    finally:
        mitsuba.set_variant(mitsuba_choice.variant)
    means = [environment.spherical_mean(radiance) for radiance in (slow, fast)]
    np.testing.assert_allclose(means[0], means[1], rtol=0.03)
    np.testing.assert_allclose(np.median(slow), np.median(fast), rtol=0.05)
