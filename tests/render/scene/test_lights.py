"""Prepared lights: scaled, and neither energy nor place lost at any resolution."""

import dataclasses

import numpy as np
import pytest
from render_scenes import photographed

from lime_keras.optics import environment, shading, shininess
from lime_keras.render.scene import lights
from lime_keras.render.scene.quality import FAST

EXPONENTS = 10.0**shininess.LOG_MEANS


@pytest.fixture(scope="module")
def light():
    return lights.prepare("photographed", photographed())


def cut(light, exponent):
    """The cut for lobes in all directions."""
    return light.cut(exponent, np.pi, np.array([[0.0, 0.0, 1.0]]), np.array([np.pi]))[0]


@pytest.mark.parametrize("mean", [lights.MEAN_RADIANCE, 1.0, 7.5])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_spherical_mean_is_the_one_asked_for(mean, scale):
    light = lights.prepare("x", photographed(64) * scale, mean)
    assert environment.spherical_mean(light.radiance) == pytest.approx(mean, rel=1e-5)
    for level in light.levels.values():
        assert level.energy.sum(dtype=float) == pytest.approx(4 * np.pi * mean, rel=1e-5)


def test_every_level_holds_the_energy_and_the_first_moment_of_the_finest(light):
    fine = light.radiance.astype(float) * environment.solid_angles(256, 512)
    moment = fine[..., None] * environment.directions(256, 512)
    assert sorted(light.levels) == [16, 32, 64, 128, 256]
    for height, level in light.levels.items():
        blocks = height, 256 // height, 2 * height, 256 // height
        np.testing.assert_allclose(level.energy, fine.reshape(blocks).sum((1, 3)), rtol=1e-5)
        expected = moment.reshape(*blocks, 3).sum((1, 3))
        expected /= np.linalg.norm(expected, axis=-1, keepdims=True)
        np.testing.assert_allclose(level.direction, expected, atol=1e-6)


def test_a_lamp_stays_where_it_is_on_every_level():
    radiance = np.zeros((256, 512))
    radiance[77, 400] = 1.0
    light = lights.prepare("lamp", radiance)
    there = environment.directions(256, 512)[77, 400]
    for level in light.levels.values():
        lit = level.direction[level.energy > 0]
        np.testing.assert_allclose(lit, [there], atol=1e-6)
    np.testing.assert_allclose(light.strong_direction, there, atol=1e-6)


def test_black_texels_still_have_unit_directions():
    radiance = np.zeros((64, 128))
    radiance[3, 3] = 1.0
    for level in lights.prepare("lamp", radiance).levels.values():
        np.testing.assert_allclose(np.linalg.norm(level.direction, axis=-1), 1, rtol=1e-5)


@pytest.mark.parametrize("rows", [8, 128, 256])
def test_the_table_of_d_is_the_sum_over_every_texel(light, rows):
    quality = dataclasses.replace(FAST, irradiance_rows=rows)
    table = lights.prepare("photographed", photographed(), quality=quality).diffuse_shading
    normals = environment.directions(rows, 2 * rows)
    some = np.random.default_rng(0).integers(rows, size=(2, 60))
    texels = shading.texels(light.radiance.astype(float))
    np.testing.assert_allclose(
        table[*some], shading.diffuse(normals[*some], *texels), rtol=1e-5, atol=0
    )


def test_the_side_away_from_a_lamp_is_black():
    radiance = np.zeros((256, 512))
    radiance[77, 400] = 1e3
    table = lights.prepare("lamp", radiance).diffuse_shading
    facing = environment.directions(128, 256) @ environment.directions(256, 512)[77, 400]
    assert (table >= 0).all() and table[facing < 0].max() < 1e-12 * table.max()


@pytest.mark.parametrize("exponent", [0.0, *EXPONENTS, 1e4])
def test_a_cut_holds_all_energy_and_every_texel_once(light, exponent):
    directions, energies = cut(light, exponent)
    assert energies.sum(dtype=float) == pytest.approx(4 * np.pi * lights.MEAN_RADIANCE, rel=1e-5)
    finest = light.levels[256]
    moment = np.tensordot(finest.energy.astype(float), finest.direction, 2)
    np.testing.assert_allclose(energies.astype(float) @ directions, moment, atol=1e-2)
    assert (energies > 0).all()
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, rtol=1e-5)


def test_shinier_lobes_get_more_lights(light):
    counts = [len(cut(light, exponent)[1]) for exponent in EXPONENTS]
    assert counts == sorted(counts) and counts[-1] > 4 * counts[0]
    assert counts[-1] < 256 * 512 / 2


def test_a_brighter_lamp_gets_more_lights_and_the_walls_fewer():
    there = environment.directions(256, 512)[104, 204]
    near, far = [], []
    for strength in (0, 30, 1_000):
        lamp = np.ones((256, 512))
        lamp[100:108, 200:208] += strength
        close = cut(lights.prepare("lamp", lamp), 50.0)[0] @ there > np.cos(np.radians(6))
        near.append(close.sum())
        far.append((~close).sum())
    assert near[0] < near[1] <= near[2]
    assert far[0] > far[2]


def test_a_group_of_lobes_gets_the_lights_near_it_whatever_the_other_groups(light):
    axes = environment.directions(3, 4).reshape(-1, 3)
    radii, support = np.linspace(0, 0.3, len(axes)), 0.5
    whole = cut(light, 200.0)[1]
    together = light.cut(200.0, support, axes, radii)
    for axis, radius, (directions, energies) in zip(axes, radii, together, strict=True):
        [alone] = light.cut(200.0, support, axis[None], np.array([radius]))
        np.testing.assert_array_equal(directions, alone[0])
        np.testing.assert_array_equal(energies, alone[1])
        assert (directions @ axis >= np.cos(support + radius) - 1e-6).all()
        assert 0 < len(energies) < len(whole) / 2
        # What is left out is what lies beyond, but for texels on the border.
        finest = light.levels[256]
        within = finest.direction @ axis >= np.cos(support + radius)
        assert energies.sum() == pytest.approx(finest.energy[within].sum(), rel=0.1)


@pytest.mark.parametrize(
    ("value", "message"), [(0.0, "mean radiance is 0"), (np.nan, "nan"), (np.inf, "inf")]
)
def test_a_light_that_does_not_shine_is_refused_by_name(value, message):
    with pytest.raises(ValueError, match=rf"dark\.exr: .*{message}"):
        lights.prepare("dark.exr", np.full((64, 128), value))


@pytest.mark.parametrize(
    "shape",
    [
        *((1, 2), (2, 4), (3, 6), (16, 32), (31, 63), (32, 63), (513, 1025)),
        *((height, 2 * height) for height in (32, 48, 63, 64, 100, 512)),
    ],
)
def test_an_even_map_of_any_size_is_a_furnace(shape):
    light = lights.prepare("even", np.full(shape, 3.0), 1.0)
    if shape[1] == 2 * shape[0] >= 64:
        assert max(light.levels) == min(256, 1 << (shape[0].bit_length() - 1))
    np.testing.assert_allclose(light.diffuse_shading, 1, rtol=0.01)
    np.testing.assert_allclose(light.radiance, 1, rtol=1e-6)
    assert cut(light, 10.0)[1].sum() == pytest.approx(4 * np.pi, rel=1e-5)


@pytest.mark.parametrize("shape", [(1, 2), (2, 4), (5, 10), (31, 63)])
def test_a_small_map_lights_from_where_its_texels_are(shape):
    small = np.random.default_rng(0).exponential(1.0, shape)
    light = lights.prepare("small", small, environment.spherical_mean(small))
    rows, columns = shape
    down, across = np.indices((64, 128)) + 0.5
    there = small[(down * rows / 64).astype(int), (across * columns / 128).astype(int)]
    directions = environment.directions(64, 128)
    np.testing.assert_allclose(
        np.tensordot(light.levels[32].energy, light.levels[32].direction, 2),
        np.tensordot(there * environment.solid_angles(64, 128), directions, 2),
        atol=0.02 * 4 * np.pi,
    )
    assert light.levels[32].energy.sum() == pytest.approx(
        4 * np.pi * environment.spherical_mean(small), rel=1e-5
    )
