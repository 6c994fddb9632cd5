"""Mixtures of rolled maps and lamps: exact where they must be, and of the right power."""

import os
import subprocess
import sys

import numpy as np
import pytest
from keras import ops
from small_lights import SHAPE, bank, generators, suns

from lime_keras.optics import environment
from lime_keras.synthesis import light_law, mixing

FINE = (64, 128)


def draw_of(batch=1, **values):
    """A drawn light of one map, unmoved, and no lamps, but for what is given."""
    lamps = np.zeros((batch, light_law.LAMPS, 15), np.float32)
    lamps[..., light_law.LAMP_PARTS["towards"]] = (0, 0, 1)
    lamps[..., light_law.LAMP_PARTS["across"]] = (1, 0, 0)
    lamps[..., light_law.LAMP_PARTS["half"]] = 0.1
    lamps[..., light_law.LAMP_PARTS["bars_half"]] = -10
    weights = np.zeros((batch, 3), np.float32)
    weights[:, 0] = environment.MEAN_RADIANCE
    light = light_law.LightDraw(
        maps=np.zeros((batch, 3), np.int32),
        weights=weights,
        shifts=np.zeros((batch, 3), np.int32),
        mirrored=np.zeros((batch, 3), bool),
        lamps=lamps,
        rotation=np.broadcast_to(np.eye(3, dtype=np.float32), (batch, 3, 3)),
    )
    return light._replace(**values)


def lamp_of(towards, along=None, power=0.4, **parts):
    """A light of one lamp and no maps; `along` is made to stand at a right angle to `towards`."""
    light = draw_of(weights=np.zeros((1, 3), np.float32))
    towards = np.array(towards, float) / np.linalg.norm(towards)
    along = np.array([0.3, 0.2, -0.7] if along is None else along, float)
    along -= towards * (along @ towards)
    numbers = {"towards": towards, "across": along / np.linalg.norm(along), "power": power, **parts}
    for name, value in numbers.items():
        light.lamps[0, 0, light_law.LAMP_PARTS[name]] = value
    return light


def lit(light, shape=FINE):
    return mixing.mixed(np.zeros((1, *shape), np.float32), light)[0].astype(float)


def unit_maps(count=3, seed=0):
    maps = np.random.default_rng(seed).exponential(size=(count, *SHAPE))
    shares = environment.solid_angles(*SHAPE) / (4 * np.pi)
    return (maps / np.sum(maps * shares, axis=(1, 2), keepdims=True)).astype(np.float32)


@pytest.mark.parametrize("shift", [0, 1, 40, SHAPE[1] - 1])
@pytest.mark.parametrize("mirror", [False, True])
def test_a_map_is_mirrored_and_rolled(shift, mirror):
    maps = unit_maps()
    light = draw_of(
        maps=np.array([[2, 0, 0]], np.int32),
        shifts=np.array([[shift, 3, 5]], np.int32),
        mirrored=np.array([[mirror, True, False]]),
    )
    expected = np.roll(maps[2][:, ::-1] if mirror else maps[2], shift, axis=1)
    np.testing.assert_allclose(mixing.mixed(maps, light)[0], 0.4 * expected, rtol=1e-6)


def test_rolling_turns_about_the_vertical_and_mirroring_flips_x():
    """The law counts on both when it turns the strongest light to the front."""
    towards = environment.directions(*SHAPE)
    angle = 2 * np.pi * 5 / SHAPE[1]
    turn = [[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]]
    np.testing.assert_allclose(
        np.roll(towards, -5, axis=1), towards @ np.transpose(turn), atol=1e-12
    )
    np.testing.assert_allclose(towards[:, ::-1], towards * (-1, 1, 1), atol=1e-12)


def test_a_mixture_is_the_sum_of_its_maps():
    maps = unit_maps()
    weights = np.array([[0.1, 0.05, 0.25]], np.float32)
    light = draw_of(weights=weights, maps=np.array([[0, 1, 2]], np.int32))
    expected = np.einsum("k,khw->hw", weights[0], maps)
    np.testing.assert_allclose(mixing.mixed(maps, light)[0], expected, rtol=1e-5)


def test_the_mean_is_the_exposure_whatever_is_mixed():
    held = suns(sun=1e6)
    assert held.scale.max() > 10
    light = light_law.draw(generators(64), held, np.arange(9))
    for radiance in mixing.mixed(held.radiance, light):
        environment.check(radiance)
        assert environment.spherical_mean(radiance) == pytest.approx(0.4, rel=1e-6)


def test_half_floats_lose_no_more_than_their_rounding():
    held = suns()
    light = light_law.draw(generators(16), held, np.arange(9))
    half = mixing.mixed(held.radiance, light)
    full = mixing.mixed(held.radiance.astype(np.float32), light)
    assert half.dtype == np.float32
    np.testing.assert_allclose(half, full, rtol=1e-6)


def test_extreme_lights_are_finite():
    black, texel = np.zeros(SHAPE), np.zeros(SHAPE)
    texel[7, 11] = 1
    held = bank([black, texel, np.ones(SHAPE)])
    maps = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 2], [2, 1, 1]], np.int32)
    weights = 0.4 * np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0]], np.float32)
    light = draw_of(4, maps=maps, weights=weights * held.scale[maps])
    radiance = mixing.mixed(held.radiance, light)
    assert np.all(np.isfinite(radiance))
    assert not radiance[0].any() and not radiance[2:].any()
    assert np.flatnonzero(radiance[1]) == [7 * SHAPE[1] + 11]
    assert environment.spherical_mean(radiance[1]) == pytest.approx(0.4, rel=1e-6)
    # A black map and a lamp: the lamp is all of the light.
    light.lamps[0, 2, light_law.LAMP_PARTS["power"]] = 1e-3
    alone = mixing.mixed(held.radiance, light)[0]
    assert environment.spherical_mean(alone) == pytest.approx(0.4, rel=1e-6)


def test_the_smallest_lamp_keeps_its_power_and_its_place_wherever_it_falls():
    """Beside an even map of the same power: each is half of the light."""
    maps, shares = np.ones((1, *FINE), np.float32), environment.solid_angles(*FINE) / (4 * np.pi)
    towards = environment.directions(*FINE)
    for rng in generators(60):
        middle = rng.normal(size=3)
        light = lamp_of(middle, power=0.2, half=np.tan(np.radians(0.5)), roundness=1)
        light.weights[0, 0] = 0.2
        radiance = mixing.mixed(maps, light)[0].astype(float)
        assert radiance.min() == pytest.approx(0.2, rel=1e-5)
        lamp = (radiance - radiance.min()) * shares
        assert lamp.sum() == pytest.approx(0.2, rel=1e-3)
        place = np.sum(lamp[..., None] * towards, axis=(0, 1)) / lamp.sum()
        angle = np.arccos(place @ middle / np.linalg.norm(place) / np.linalg.norm(middle))
        assert angle < 0.25 * np.pi / FINE[0]


def supersampled(light, shape, times=4):
    """The lamp's border, bars and all, by its definition at many points of each texel."""
    lamp = {
        name: light.lamps[0, 0, part].astype(float) for name, part in light_law.LAMP_PARTS.items()
    }
    towards = environment.directions(shape[0] * times, shape[1] * times)
    z = towards @ lamp["towards"]
    up = np.cross(lamp["towards"], lamp["across"])
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = (np.abs(towards @ axis / z) for axis in (lamp["across"], up))
    corner = lamp["roundness"] * lamp["half"][1]
    over = np.stack([x - lamp["half"][0] + corner, y - lamp["half"][1] + corner])
    inside = np.where(over.max(0) > 0, np.hypot(*np.maximum(over, 0)) <= corner, True)
    inside &= z > 0
    for distance, at, half in zip((x, y), lamp["bars_at"], lamp["bars_half"], strict=True):
        inside &= np.abs(distance - at) * z > half
    weights = environment.solid_angles(shape[0] * times, shape[1] * times)
    blocks = (shape[0], times, shape[1], times)
    covered = np.sum((inside * weights).reshape(blocks), (1, 3))
    return covered / np.sum(weights.reshape(blocks), (1, 3))


LAMPS = {
    "disc": {"half": np.tan(np.radians(15)), "roundness": 1},
    "square": {"half": (0.4, 0.3)},
    "tube": {"half": (0.8, 0.12), "roundness": 1},
    "window with a cross": {"half": (0.6, 0.45), "bars_half": 0.06},
    "window with four bars": {"half": (0.6, 0.5), "bars_half": 0.05, "bars_at": (0.2, 0.17)},
}


@pytest.mark.parametrize("name", LAMPS)
@pytest.mark.parametrize("towards", [(0.2, 0.1, 1), (-1, 0.6, -0.4), (0.05, 1, 0.02)])
def test_lamps_have_their_shape(name, towards):
    """Against samples of the border itself, at any angle, over the seam and over the pole."""
    shape = (256, 512)
    light = lamp_of(towards, **LAMPS[name])
    shares = environment.solid_angles(*shape) / (4 * np.pi)
    expected = supersampled(light, shape)
    expected *= 0.4 / np.sum(expected * shares)
    assert np.sum(np.abs(lit(light, shape) - expected) * shares) < 0.04 * 0.4


def test_soft_edges_fade_over_their_width():
    """A soft box of half length 0.3, whose edge of 0.2 reaches from 0.2 to 0.4."""
    light = lamp_of((0, 0, 1), along=(1, 0, 0), half=0.3, softness=0.2)
    radiance = lit(light, (256, 512))
    towards = environment.directions(256, 512)
    row = radiance[127] / radiance.max()
    across = np.where(towards[127, :, 2] > 0, np.abs(towards[127, :, 0] / towards[127, :, 2]), 9)
    np.testing.assert_allclose(row[across < 0.19], 1)
    assert not row[across > 0.42].any()
    np.testing.assert_allclose(row[np.abs(across - 0.3) < 0.004], 0.5, atol=0.03)


@pytest.mark.parametrize("name", LAMPS)
def test_nothing_sharp_shines_beyond_its_horizon(name):
    for rng in generators(8):
        middle = rng.normal(size=3)
        light = lamp_of(middle, **LAMPS[name])
        behind = environment.directions(*FINE) @ middle < 0
        assert not lit(light)[behind].any()


def test_maps_too_coarse_for_a_lamp_show_all_of_it():
    for rng in generators(20):
        for form in (0, 1):
            light = lamp_of(rng.normal(size=3), half=1e-4, roundness=form)
            radiance = lit(light, (16, 32))
            assert environment.spherical_mean(radiance) == pytest.approx(0.4, rel=1e-6)
            assert np.count_nonzero(radiance) < 70


@pytest.fixture(scope="module")
def mixture():
    """A bank's maps, a batch of lights, and their mixtures in NumPy."""
    held = suns()
    light = light_law.draw(generators(8), held, np.arange(9))
    return held.radiance, light, mixing.mixed(held.radiance, light)


def close(found, expected):
    """Equal up to rounding: at a lamp's edge, that of its width over a texel."""
    largest = expected.max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(found / largest, expected / largest, atol=2e-5)


def test_tensors_give_what_numpy_gives(mixture):
    import tensorflow as tf

    radiance, light, expected = mixture
    tensors = light_law.LightDraw(*map(ops.convert_to_tensor, light))
    maps = ops.convert_to_tensor(radiance)
    close(ops.convert_to_numpy(mixing.mixed(maps, tensors)), expected)
    compiled = tf.function(mixing.mixed, jit_compile=True)
    close(compiled(maps, tensors).numpy(), expected)


def test_jax_gives_what_numpy_gives(mixture, tmp_path):
    pytest.importorskip("jax")
    radiance, light, expected = mixture
    np.savez(tmp_path / "given.npz", radiance=radiance, **light._asdict())
    code = (
        "import sys, jax, numpy as np\n"
        "from keras import ops\n"
        "from lime_keras.synthesis import light_law, mixing\n"
        "given = dict(np.load(sys.argv[1] + '/given.npz'))\n"
        "maps = ops.convert_to_tensor(given.pop('radiance'))\n"
        "light = light_law.LightDraw(**{k: ops.convert_to_tensor(v) for k, v in given.items()})\n"
        "np.save(sys.argv[1] + '/found.npy', jax.jit(mixing.mixed)(maps, light))\n"
        "assert 'tensorflow' not in sys.modules\n"
    )
    environ = {**os.environ, "KERAS_BACKEND": "jax", "JAX_PLATFORMS": "cpu"}
    answer = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], env=environ, capture_output=True, text=True
    )
    assert answer.returncode == 0, answer.stderr
    close(np.load(tmp_path / "found.npy"), expected)
