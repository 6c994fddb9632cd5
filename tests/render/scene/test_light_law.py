"""The law of mixed lights: seeded, of one power, strongest in front, and as its tables say."""

import math

import numpy as np
import pytest

from lime_keras.render.scene import light_law


@pytest.fixture(scope="module")
def many():
    return [light_law.draw(np.random.default_rng([7, k]), 9) for k in range(3000)]


def test_a_light_follows_from_its_generator(many):
    again = light_law.draw(np.random.default_rng([7, 11]), 9)
    for before, now in zip(many[11][:4], again[:4], strict=True):
        np.testing.assert_array_equal(before, now)
    assert str(many[11].lamps) == str(again.lamps)
    assert many[11].powers[0] != many[12].powers[0]


def test_the_powers_add_up_to_one(many):
    for light in many:
        powers = [*light.powers, *(lamp.power for lamp in light.lamps)]
        assert min(powers) >= 0 and sum(powers) == pytest.approx(1)


def test_counts_and_shares_are_those_of_the_tables(many):
    maps = np.bincount([len(light.maps) for light in many], minlength=4) / len(many)
    np.testing.assert_allclose(maps, [0, *light_law._MAP_COUNTS], atol=0.03)
    lamps = np.array([len(light.lamps) for light in many])
    assert lamps.max() == 6 and np.mean(lamps == 0) == pytest.approx(0.4, abs=0.03)
    uses = np.bincount(np.concatenate([light.maps for light in many]), minlength=9)
    np.testing.assert_allclose(uses / uses.sum(), 1 / 9, atol=0.02)
    assert np.mean([light.mirrored.mean() for light in many]) == pytest.approx(0.5, abs=0.03)
    for setting in light_law._SETTINGS:
        assert sum(setting.kinds.values()) == pytest.approx(1)
        assert setting.kinds.keys() <= light_law._KINDS.keys()


def test_maps_fill_the_half_in_front(many):
    azimuths = np.concatenate([light.azimuths for light in many])
    counts, _ = np.histogram(azimuths, np.linspace(math.pi / 2, 3 * math.pi / 2, 7))
    assert counts.sum() == len(azimuths)
    np.testing.assert_allclose(counts / counts.sum(), 1 / 6, atol=0.03)


def test_lamps_stand_in_front_but_for_weak_rim_lights(many):
    behind = 0
    for light in many:
        front = [lamp for lamp in light.lamps if lamp.towards[2] > -1e-9]
        for number, lamp in enumerate(light.lamps):
            assert np.linalg.norm(lamp.towards) == pytest.approx(1)
            assert lamp.across @ lamp.towards == pytest.approx(0, abs=1e-9)
            if lamp.towards[2] > -1e-9:
                continue
            assert number > 0
            behind += 1

            def coarse(one):
                return one.power * min((math.pi / 16) ** 2 / light_law._area(one), 1)

            most = 0.8001 if lamp.half[0] > math.tan(math.radians(34)) else 0.2501
            assert coarse(lamp) <= most * max(map(coarse, front))
    assert 0.1 < behind / sum(max(len(light.lamps) - 1, 0) for light in many) < 0.35


def test_lamps_have_the_sizes_of_their_kinds(many):
    lamps = [lamp for light in many for lamp in light.lamps]
    angles = np.degrees(np.arctan([lamp.half for lamp in lamps]))
    assert angles[:, 0].min() < 0.55 and angles[:, 0].max() > 60
    assert np.all(angles[:, 1] <= angles[:, 0] + 1e-9)
    assert all(lamp.softness <= 1.6 * lamp.half[1] for lamp in lamps)
    windows = [lamp for lamp in lamps if lamp.bar]
    assert 0.05 < len(windows) / len(lamps) < 0.3
    for lamp in windows:  # upright: level, or as steep as their place lets them be
        upright = math.sqrt(1 - lamp.towards[1] ** 2)
        assert min(abs(lamp.across[1]), abs(abs(lamp.across[1]) - upright)) < 1e-6
