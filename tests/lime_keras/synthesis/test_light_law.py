"""The law of drawn lights: seeded, of one power, strongest in front, and as its tables say."""

import numpy as np
import pytest
from small_lights import SHAPE, bank, generators, suns

from lime_keras.optics import environment
from lime_keras.synthesis import light_law, mixing

ALL = np.arange(9)


def part(light, name):
    return light.lamps[..., light_law.LAMP_PARTS[name]]


@pytest.fixture(scope="module")
def held():
    return suns()


@pytest.fixture(scope="module")
def many(held):
    return light_law.draw(generators(4000), held, ALL)


class Numbers:
    """A generator that gives the same number again and again."""

    def __init__(self, number):
        self.number = number

    def random(self, count):
        return np.full(count, self.number)


def test_a_light_follows_from_its_own_generator_alone(held, many):
    few = light_law.draw(generators(40)[30:], held, ALL)
    for together, apart in zip(many, few, strict=True):
        np.testing.assert_array_equal(together[30:40], apart)
    other = light_law.draw(generators(40, seed=1), held, ALL)
    assert not np.any(
        np.all(other.weights == many.weights[:40], axis=1) & (other.weights[:, 1] > 0)
    )


def test_arrays_have_fixed_sizes_and_types(many):
    kinds = [(x.shape[1:], x.dtype.name) for x in many]
    assert kinds == [
        ((3,), "int32"),
        ((3,), "float32"),
        ((3,), "int32"),
        ((3,), "bool"),
        ((6, 15), "float32"),
        ((3, 3), "float32"),
    ]
    assert sum(x.stop - x.start for x in light_law.LAMP_PARTS.values()) == 15


def test_the_power_is_the_exposure(held, many):
    powers = many.weights / held.scale[many.maps]
    assert powers.min() >= 0 and part(many, "power").min() >= 0
    total = powers.sum(1) + part(many, "power").sum((1, 2))
    np.testing.assert_allclose(total, environment.MEAN_RADIANCE, rtol=1e-6)


def test_counts_and_shares_are_those_of_the_tables(many):
    maps = np.bincount((many.weights > 0).sum(1), minlength=4) / len(many.weights)
    np.testing.assert_allclose(maps, [0, *light_law._MAP_COUNTS], atol=0.03)
    lamps = (part(many, "power")[..., 0] > 0).sum(1)
    assert lamps.max() == light_law.LAMPS
    assert np.mean(lamps == 0) == pytest.approx(light_law._SETTINGS[0, 0], abs=0.03)
    share = part(many, "power").sum((1, 2)) / environment.MEAN_RADIANCE
    assert share.max() > 0.95 and np.all(share <= light_law._SETTINGS[:, 4].max() + 1e-6)
    uses = np.bincount(many.maps.flat, minlength=len(ALL)) / many.maps.size
    np.testing.assert_allclose(uses, 1 / len(ALL), atol=0.01)
    assert np.mean(many.mirrored) == pytest.approx(0.5, abs=0.02)
    for table in (light_law._SETTINGS[:, 0], light_law._MAP_COUNTS, *light_law._KINDS_OF):
        assert sum(table) == pytest.approx(1)


def test_only_allowed_maps_are_drawn(held):
    light = light_law.draw(generators(50), held, np.array([7]))
    assert np.all(light.maps == 7)
    light = light_law.draw(generators(50), held, np.array([2, 5]))
    assert set(light.maps.flat) == {2, 5}
    with pytest.raises(ValueError, match="at least one"):
        light_law.draw(generators(1), held, np.array([], int))


def test_rotations_tilt_by_the_pitch(many):
    products = many.rotation @ many.rotation.swapaxes(1, 2)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), (4000, 3, 3)), atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(many.rotation), 1, rtol=1e-6)
    pitch = np.arcsin(many.rotation[:, 2, 1])
    low, high = environment.CAMERA_PITCH
    assert low <= pitch.min() < low + 0.02 and high - 0.02 < pitch.max() <= high
    assert np.all(many.rotation[:, 0] == [1, 0, 0])


def placed(held, light):
    """Strongest light of each map, after mirroring and rolling, in camera space."""
    strong = held.strong_direction[light.maps].astype(float)
    strong[..., 0] *= np.where(light.mirrored, -1, 1)
    turn = light.shifts * 2 * np.pi / held.radiance.shape[2]
    x, y, z = np.moveaxis(strong, -1, 0)
    azimuth = np.arctan2(x, -z) + turn
    across = np.hypot(x, z)
    turned = np.stack([across * np.sin(azimuth), y, -across * np.cos(azimuth)], axis=-1)
    return np.einsum("bij,bkj->bki", light.rotation, turned)


def test_the_strongest_light_of_each_map_is_in_front(held, many):
    """Also where it stands near the zenith or the nadir: then the camera looks accordingly."""
    z = placed(held, many)[..., 2][many.weights > 0]
    # Where the range is narrower than a column, the roll is as near to it as columns allow.
    assert z.min() > -1e-3 and np.mean(z < 0) < 1e-3
    assert z.min() < 0.05 and z.max() > 0.95


def test_azimuths_fill_the_half_in_front(held):
    """A sun on the horizon stands at any side with the same chance, as with `lime-render`."""
    maps = np.zeros((1, *SHAPE))
    maps[0, SHAPE[0] // 2, 3] = 1
    horizon = bank(maps)
    light = light_law.draw(generators(2000), horizon, np.array([0]))
    x, _, z = np.moveaxis(placed(horizon, light), -1, 0)
    azimuth = np.degrees(np.arctan2(x, z))
    counts, _ = np.histogram(azimuth[light.weights > 0], np.linspace(-90, 90, 7))
    np.testing.assert_allclose(counts / counts.sum(), 1 / 6, atol=0.03)


def test_poles_are_in_front_if_the_camera_looks_so():
    maps = np.zeros((2, *SHAPE))
    maps[0, 0, 5] = maps[1, -1, 9] = 1
    poles = bank(maps)
    poles.strong_direction = np.array([[0, 1, 0], [0, -1, 0]], np.float32)
    above = light_law.draw(generators(300), poles, np.array([0]))
    below = light_law.draw(generators(300), poles, np.array([1]))
    assert np.all(above.rotation[:, 2, 1] >= 0) and np.all(below.rotation[:, 2, 1] <= 0)
    both = light_law.draw(generators(300), poles, np.array([0, 1]))
    assert all(np.all(np.isfinite(values)) for values in both)


def test_lamps_stand_in_front_but_for_weak_rim_lights(many):
    towards = np.einsum("bij,bkj->bki", many.rotation, part(many, "towards"))
    np.testing.assert_allclose(np.linalg.norm(towards, axis=-1), 1, rtol=1e-5)
    power = part(many, "power")[..., 0]
    lit = power > 0
    behind = lit & (towards[..., 2] < -1e-6)
    assert not behind[:, 0].any() and 0.1 < behind[:, 1:].sum() / lit[:, 1:].sum() < 0.35
    length, width = np.moveaxis(part(many, "half"), -1, 0)
    corner = part(many, "roundness")[..., 0] * width
    area = 4 * length * width - (4 - np.pi) * corner**2
    texel = power * np.minimum((np.pi / 16) ** 2 / area, 1)
    strongest = np.max(np.where(behind, 0, texel), axis=1)
    most = np.where(length > np.tan(np.radians(34)), 0.8001, 0.2501)
    assert np.all((texel <= most * strongest[:, None])[behind])


def test_lamps_are_of_the_sizes_of_their_kinds(many):
    towards, across = part(many, "towards"), part(many, "across")
    np.testing.assert_allclose(np.sum(towards * across, -1), 0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(across, axis=-1), 1, rtol=1e-5)
    angle = np.degrees(np.arctan(part(many, "half")))
    assert angle[..., 0].min() < 0.55 and angle[..., 0].max() > 60
    assert np.all(angle[..., 1] <= angle[..., 0] + 1e-5)
    assert np.all(part(many, "softness")[..., 0] <= 1.6 * part(many, "half")[..., 1] + 1e-6)
    barred = part(many, "bars_half")[..., 0] > 0
    assert barred.any() and not np.all(barred)
    # Windows are upright: the length is level, or its vertical part is all that their tilt leaves.
    level = np.abs(across[barred][:, 1])
    upright = np.sqrt(1 - towards[barred][:, 1] ** 2)
    assert np.all((level < 1e-6) | (np.abs(level - upright) < 1e-5))


@pytest.mark.parametrize("number", [0.0, 0.5, np.nextafter(1, 0)])
def test_the_ends_of_all_ranges_are_lights(held, number):
    light = light_law.draw([Numbers(number)], held, ALL)
    assert all(np.all(np.isfinite(values)) for values in light)
    radiance = mixing.mixed(held.radiance, light)[0]
    assert environment.spherical_mean(radiance) == pytest.approx(0.4, rel=1e-5)
    assert 0 <= light.shifts.min() and light.shifts.max() < SHAPE[1]


def test_the_strongest_of_the_whole_light_is_in_front(held):
    """But for the exceptions that the module states."""
    light = light_law.draw(generators(400), held, ALL)
    energy = mixing.mixed(held.radiance, light) * environment.solid_angles(*SHAPE)
    towards = environment.directions(*SHAPE)
    coarse = energy.reshape(-1, 16, 2, 32, 2).sum((2, 4)).reshape(400, -1)
    moment = (energy[..., None] * towards).reshape(-1, 16, 2, 32, 2, 3).sum((2, 4))
    strongest = moment.reshape(400, -1, 3)[np.arange(400), coarse.argmax(1)]
    z = np.einsum("bj,bj->b", light.rotation[:, 2], strongest)
    assert np.mean(z > 0) > 0.97
