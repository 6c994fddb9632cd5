"""Rooms: analytic scenes, conventions, dynamic range, determinism, in every variant at hand."""

import os

import mitsuba as mi
import numpy as np
import pytest
from lime_keras.render import environments, rooms

VARIANTS = ["scalar_rgb"] + ["llvm_ad_rgb"] * ("DRJIT_LIBLLVM_PATH" in os.environ)


@pytest.fixture(params=VARIANTS)
def variant(request):
    before = mi.variant()
    mi.set_variant(request.param)
    yield request.param
    if before:
        mi.set_variant(before)


def empty_room(*lights, albedo=0.0, viewpoint=(0.0, 1.0, 0.0)):
    walls = [
        rooms.Panel(p.corner, p.across, p.up, ((albedo,),))
        for p in rooms._walls(np.random.default_rng(0), np.array([4.0, 3.0, 5.0]))
    ]
    return rooms.Room((4.0, 3.0, 5.0), viewpoint, tuple(walls), (), lights)


def ball(centre, radius, radiance):
    solid = rooms.Solid("sphere", tuple(centre), (radius,) * 3, 0.0, 0.0)
    return rooms.Light(radiance, solids=(solid,))


@pytest.mark.parametrize(
    "direction",
    [(0, 0, -1), (1, 0, 0.3), (-1, 0.2, 0), (0.1, 0, 1), (0.3, 1, 0.1), (0.4, -1, 0.2), (1, 1, 1)],
)
def test_lamp_is_seen_where_it_hangs_with_its_energy(variant, direction):
    direction = np.array(direction) / np.linalg.norm(direction)
    room = empty_room(ball(np.array([0, 1, 0]) + 0.9 * direction, 0.05, 1000.0))
    radiance = rooms.render(room, height=64, samples=64, seed=0).astype(float)
    v, u = (np.mgrid[:64, :128].reshape(2, 64, 128) + 0.5) / [[[64]], [[128]]]
    axes = [np.sin(np.pi * v) * np.sin(2 * np.pi * u), np.cos(np.pi * v)]
    axes = np.stack([*axes, -np.sin(np.pi * v) * np.cos(2 * np.pi * u)])
    weighted = radiance * environments.solid_angles(64)[:, None]
    centroid = (axes * weighted).sum((1, 2))
    np.testing.assert_allclose(centroid / np.linalg.norm(centroid), direction, atol=0.02)
    solid_angle = 2 * np.pi * (1 - np.sqrt(1 - (0.05 / 0.9) ** 2))
    np.testing.assert_allclose(weighted.sum(), 1000 * solid_angle, rtol=0.1)


def test_inside_a_uniform_light_everything_is_its_radiance(variant):
    room = empty_room(*(rooms.Light(2.5, panels=(wall,)) for wall in empty_room().panels))
    room = rooms.Room(room.size, room.viewpoint, (), (), room.lights)
    np.testing.assert_allclose(rooms.render(room, height=32, samples=4, seed=0), 2.5, rtol=1e-5)


def test_direct_light_on_the_floor_agrees_with_the_inverse_square_law(variant, monkeypatch):
    room = empty_room(ball((0, 2.5, 0), 0.1, 100.0), albedo=0.5, viewpoint=(0.0, 1.0, 0.3))
    monkeypatch.setattr(rooms, "BOUNCES", 2)  # one reflection
    rooms._scene.cache_clear()
    radiance = rooms.render(room, height=64, samples=256, seed=0)
    rooms._scene.cache_clear()
    below = np.array([0, 0, 0.3])
    lamp = np.array([0, 2.5, 0]) - below
    irradiance = 100 * np.pi * 0.1**2 / (lamp @ lamp) * lamp[1] / np.linalg.norm(lamp)
    np.testing.assert_allclose(radiance[-2:].mean(), 0.5 / np.pi * irradiance, rtol=0.06)


def test_same_seed_same_map_and_zero_is_a_seed(variant):
    room = rooms.sample(np.random.default_rng(3))
    maps = [rooms.render(room, height=32, samples=4, seed=seed) for seed in (0, 0, 1)]
    np.testing.assert_allclose(maps[0], maps[1], rtol=1e-4, atol=1e-6)
    assert not np.allclose(maps[0], maps[2], rtol=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_rooms_have_the_range_of_photographed_light(variant, seed):
    room = rooms.sample(np.random.default_rng(seed))
    radiance = rooms.render(room, height=64, samples=8, seed=seed)
    assert radiance.shape == (64, 128) and radiance.dtype == np.float32
    assert np.isfinite(radiance).all() and radiance.min() >= 0
    assert 5 < radiance.max() / radiance.mean() < 20000
    assert np.median(radiance) > 0


def test_rooms_do_not_leak_into_one_another(variant):
    bright = empty_room(ball((1, 2, 1), 0.2, 1000.0), albedo=0.8)
    assert rooms.render(bright, height=16, samples=4, seed=0).max() > 1
    dark = empty_room(rooms.Light(0.0), albedo=0.8)
    assert rooms.render(dark, height=16, samples=4, seed=0).max() == 0


def test_too_many_lights_are_refused(variant):
    room = empty_room(*[ball((0, 2, 0), 0.1, 1.0)] * (rooms.LIGHTS + 1))
    with pytest.raises(ValueError, match="12 lights, expected at most 11"):
        rooms.render(room, height=16, samples=1, seed=0)


def test_too_many_faces_are_refused(variant):
    panel = rooms.Panel((0, 0, 0), (1, 0, 0), (0, 1, 0), ((0.5,) * 100,) * 100)
    room = rooms.Room((4, 3, 5), (0, 1, 0), (panel,), (), ())
    with pytest.raises(ValueError, match="matte faces"):
        rooms.render(room, height=16, samples=1, seed=0)


@pytest.mark.parametrize("seed", range(40))
def test_viewpoint_is_clear_and_everything_stands_in_the_room(seed):
    room = rooms.sample(np.random.default_rng(seed))
    eye, size = np.array(room.viewpoint), np.array(room.size)
    assert (np.abs(eye[[0, 2]]) < size[[0, 2]] / 2 - 0.4).all() and 0.4 < eye[1] < size[1] - 0.4
    solids = [*room.solids, *(solid for light in room.lights for solid in light.solids)]
    for solid in solids:
        vertices = rooms._solid_piece(solid)[0]
        assert np.linalg.norm(vertices - eye, axis=1).min() > 0.2
        inside = np.linalg.norm((eye - solid.centre) / solid.extent, ord=np.inf) < 1
        assert not inside
        assert (np.abs(vertices[:, [0, 2]]) < size[[0, 2]] / 2 + 0.01).all()
        assert vertices[:, 1].min() > -0.01 and vertices[:, 1].max() < size[1] + 0.01
    assert 1 <= len(room.lights) <= rooms.LIGHTS


def test_sample_is_a_function_of_the_generator():
    first, again, other = (rooms.sample(np.random.default_rng(k)) for k in (5, 5, 6))
    assert first == again != other


@pytest.mark.parametrize("kind", ["box", "cylinder", "tube", "sphere"])
def test_solids_are_closed_and_face_outwards(kind):
    solid = rooms.Solid(kind, (1.0, 2.0, 3.0), (0.5, 0.25, 0.75), 0.7, 0.5)
    vertices, normals, faces, *_ = rooms._solid_piece(solid)
    a, b, c = vertices[faces].swapaxes(0, 1) - np.array(solid.centre)
    volume = (np.cross(a, b) * c).sum() / 6
    share = {"box": 1.0, "cylinder": np.pi / 4, "tube": np.pi / 4, "sphere": np.pi / 6}[kind]
    np.testing.assert_allclose(volume, 8 * 0.5 * 0.25 * 0.75 * share, rtol=0.04)
    flat = np.cross(b - a, c - a)
    assert (np.einsum("fk,fvk->fv", flat, normals[faces]) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-6)
