"""Lights of a bank: reduced without losing light, whatever the map."""

import numpy as np
import pytest

from lime_keras.optics import environment
from lime_keras.render.bank import lights
from lime_keras.synthesis.lights import LightBank


def restored(radiance):
    small, scale = lights.reduced(radiance)
    assert small.dtype == np.float16 and small.shape == (256, 512)
    return small.astype(np.float64) * scale


@pytest.mark.parametrize("height", [2, 48, 128, 256, 300, 512])
def test_a_map_of_any_size_keeps_its_light(height):
    """The mean is 1, and so is that of any half of the sphere, as in the map."""
    radiance = np.random.default_rng(height).exponential(1, (height, 2 * height)) ** 3
    found = restored(radiance)
    assert environment.spherical_mean(found) == pytest.approx(1, rel=1e-3)
    mean = environment.spherical_mean(radiance)
    angles = environment.solid_angles(*radiance.shape)
    left = np.sum((radiance * angles)[:, :height]) / mean
    ours = np.sum((found * environment.solid_angles(256, 512))[:, :256])
    assert ours == pytest.approx(left, rel=2e-3)


@pytest.mark.parametrize("row", [0, 128, 255])
@pytest.mark.parametrize("value", [1e-30, 1.0, 1e30])
def test_one_lit_texel_keeps_its_place_and_power(row, value):
    radiance = np.zeros((256, 512))
    radiance[row, 9] = value
    small, scale = lights.reduced(radiance)
    assert np.isfinite(small).all() and np.log2(scale) % 1 == 0
    assert np.argwhere(small).tolist() == [[row, 9]]
    assert environment.spherical_mean(small.astype(float) * scale) == pytest.approx(1, rel=1e-3)


def test_an_even_light_stays_even():
    small, scale = lights.reduced(np.full((64, 128), 7.0))
    assert scale == 1 and (small == 1).all()


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
def test_a_map_that_does_not_shine_is_refused(value):
    with pytest.raises(ValueError, match="must shine"):
        lights.reduced(np.full((64, 128), value))


def test_a_bank_has_lights_of_every_kind(rendered):
    held = LightBank(rendered)
    assert held.kinds == ["photograph", "room", "sky"]
    assert held.names[1:] == ["room-0000.exr", "sky-0000"]
    for number in range(3):
        strong = held.strong_direction[number]
        towards = environment.directions(256, 512)
        bright = held.map(number) * environment.solid_angles(256, 512)
        near = np.sum(bright[towards @ strong > np.cos(np.radians(30))])
        assert near / bright.sum() > 0.1  # of 1/15 of the sphere
