"""Mixtures of turned maps and lamps: exact where they must be, and of the right power."""

import math

import numpy as np
import pytest

from lime_keras.optics import environment
from lime_keras.render.scene import light_law, mixing
from lime_keras.render.scene.light_law import Lamp, LightDraw

ROWS = mixing.LEAST_ROWS
SHAPE = (ROWS, 2 * ROWS)
LAMPS = {
    "disc": {"half": (math.tan(math.radians(15)),) * 2, "roundness": 1.0},
    "square": {"half": (0.4, 0.3)},
    "tube": {"half": (0.8, 0.12), "roundness": 1.0},
    "window with a cross": {"half": (0.6, 0.45), "bar": 0.06},
    "window with four bars": {"half": (0.6, 0.5), "bar": 0.05, "bars_at": (0.2, 0.17)},
}


def drawn(powers=(1.0,), azimuths=None, mirrored=None, lamps=()):
    """A drawn light of so many maps, unmoved and without lamps but for what is passed."""
    count = len(powers)
    return LightDraw(
        maps=np.arange(count),
        powers=np.array(powers),
        azimuths=np.zeros(count) if azimuths is None else np.array(azimuths),
        mirrored=np.zeros(count, bool) if mirrored is None else np.array(mirrored),
        lamps=tuple(lamps),
    )


def lamp(towards, along=(0.3, 0.2, -0.7), power=1.0, **parts):
    towards = np.array(towards, float) / np.linalg.norm(towards)
    along = np.array(along, float) - towards * (np.array(along) @ towards)
    shape = {"half": (0.1, 0.1), "roundness": 0.0, "softness": 0.0, "bars_at": (0.0, 0.0)}
    shape |= {"bar": 0.0, **parts}
    return Lamp(towards=towards, across=along / np.linalg.norm(along), power=power, **shape)


def unit_map(seed, rows=ROWS):
    radiance = np.random.default_rng(seed).exponential(size=(rows, 2 * rows))
    return mixing.as_map(radiance)._replace(azimuth=0.0)


def lit(*lamps):
    """Lamps alone: the map has no power."""
    return mixing.mixed([unit_map(0)], drawn([0.0], lamps=lamps)).astype(float)


@pytest.mark.parametrize("columns", [0, 1, 40, 2 * ROWS - 1])
@pytest.mark.parametrize("mirror", [False, True])
def test_a_map_is_mirrored_and_turned(columns, mirror):
    one = unit_map(3)
    expected = np.roll(one.radiance[:, ::-1] if mirror else one.radiance, columns, axis=1)
    light = drawn(azimuths=[columns * math.pi / ROWS], mirrored=[mirror])
    np.testing.assert_allclose(mixing.mixed([one], light), expected, rtol=1e-6)


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("column", [0, 5, 100, 511])
def test_the_strongest_light_is_turned_to_its_azimuth(column, mirror):
    sun = np.full(SHAPE, 0.01)
    sun[60, column] = 1e4
    light = drawn(azimuths=[2.0], mirrored=[mirror])
    found = int(np.argmax(mixing.mixed([mixing.as_map(sun)], light))) % SHAPE[1]
    azimuth = (found + 0.5) * math.pi / ROWS
    assert abs(azimuth - 2.0) <= math.pi / 32 + math.pi / ROWS  # half a texel of 11°, and a column


def test_a_mixture_is_the_sum_of_its_maps_of_any_size():
    maps = [unit_map(0), unit_map(1, 64), unit_map(2, 512)]
    mixture = mixing.mixed(maps, drawn([0.1, 0.6, 0.3]))
    assert mixture.shape == (512, 1024) and mixture.dtype == np.float32
    large = [one.radiance.repeat(512 // len(one.radiance), 0) for one in maps]
    large = [one.repeat(1024 // one.shape[1], 1) for one in large]
    np.testing.assert_allclose(mixture, 0.1 * large[0] + 0.6 * large[1] + 0.3 * large[2], rtol=1e-5)


@pytest.mark.parametrize("shape", [(5, 10), (300, 600), (129, 257), (16, 33)])
def test_maps_of_odd_sizes_keep_their_light(shape):
    one = mixing.as_map(np.random.default_rng(0).exponential(size=shape) * 1e3)
    mixture = mixing.mixed([one], drawn())
    assert environment.spherical_mean(mixture) == pytest.approx(1, rel=1e-5)


def test_a_drawn_light_is_finite_and_of_mean_one():
    sun = np.full(SHAPE, 1e-6)
    sun[90, 7] = 1e9
    maps = [mixing.as_map(sun), mixing.as_map(np.ones((32, 64)))]
    for seed in range(40):
        light = light_law.draw(np.random.default_rng(seed), 2)
        mixture = mixing.mixed([maps[index] for index in light.maps], light)
        environment.check(mixture)
        assert environment.spherical_mean(mixture) == pytest.approx(1, rel=1e-4)


def test_the_smallest_lamp_keeps_its_power_and_its_place_wherever_it_falls():
    shares, towards = environment.solid_angles(*SHAPE) / (4 * np.pi), environment.directions(*SHAPE)
    for seed in range(30):
        middle = np.random.default_rng(seed).normal(size=3)
        half = math.tan(math.radians(0.3))
        radiance = lit(lamp(middle, half=(half, half), roundness=1.0))
        energy = radiance * shares
        assert energy.sum() == pytest.approx(1, rel=1e-4)
        place = np.sum(energy[..., None] * towards, axis=(0, 1))
        angle = np.arccos(place @ middle / np.linalg.norm(place) / np.linalg.norm(middle))
        assert angle < 0.3 * np.pi / ROWS


def supersampled(one, times=4):
    """The lamp's border, bars and all, by its definition at many points of each texel."""
    fine = (SHAPE[0] * times, SHAPE[1] * times)
    towards = environment.directions(*fine)
    z = towards @ one.towards
    with np.errstate(divide="ignore", invalid="ignore"):
        up = np.cross(one.towards, one.across)
        x, y = (np.abs(towards @ axis / z) for axis in (one.across, up))
    corner = one.roundness * one.half[1]
    over = np.stack([x - one.half[0] + corner, y - one.half[1] + corner])
    inside = np.where(over.max(0) > 0, np.hypot(*np.maximum(over, 0)) <= corner, True) & (z > 0)
    for distance, at in zip((x, y), one.bars_at, strict=True):
        inside &= (one.bar == 0) | (np.abs(distance - at) * z > one.bar)
    weights = environment.solid_angles(*fine)
    blocks = (SHAPE[0], times, SHAPE[1], times)
    return np.sum((inside * weights).reshape(blocks), (1, 3)) / np.sum(
        weights.reshape(blocks), (1, 3)
    )


@pytest.mark.parametrize("name", LAMPS)
@pytest.mark.parametrize("towards", [(0.2, 0.1, 1), (-1, 0.6, -0.4), (0.05, 1, 0.02)])
def test_lamps_have_their_shape(name, towards):
    """Against samples of the border itself, at any angle, over the seam and over the pole."""
    one = lamp(towards, **LAMPS[name])
    shares = environment.solid_angles(*SHAPE) / (4 * np.pi)
    expected = supersampled(one)
    expected /= np.sum(expected * shares)
    found = lit(one)
    assert np.sum(np.abs(found - expected) * shares) < 0.04
    assert not found[environment.directions(*SHAPE) @ one.towards < 0].any()


def test_soft_edges_fade_over_their_width():
    """A soft box of half length 0.3, whose edge of 0.2 reaches from 0.2 to 0.4."""
    radiance = lit(lamp((0, 0, 1), along=(1, 0, 0), half=(0.3, 0.3), softness=0.2))
    towards = environment.directions(*SHAPE)
    row = radiance[ROWS // 2 - 1] / radiance.max()
    x, _, z = np.moveaxis(towards[ROWS // 2 - 1], -1, 0)
    across = np.where(z > 0, np.abs(x / z), 9)
    np.testing.assert_allclose(row[across < 0.19], 1, rtol=1e-6)
    assert not row[across > 0.42].any()
    np.testing.assert_allclose(row[np.abs(across - 0.3) < 0.004], 0.5, atol=0.03)
