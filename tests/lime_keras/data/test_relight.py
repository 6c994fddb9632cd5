"""Scenes in mixtures of their lights: Σ w D, Σ w S and Σ w M, by weights that the seed draws."""

import numpy as np
import pytest
import tensorflow as tf
from hypothesis import given, settings
from hypothesis import strategies as st
from sphere_corpus import example, under_lights

from lime_keras.data import records
from lime_keras.data.recomposition import recompose
from lime_keras.data.relight import draw_weights, has_several_lights, relight
from lime_keras.optics import colour, environment
from lime_keras.optics.compositing import compose

SIZE = 24
NAMES = (*records.FEATURES, *records.FURTHER.values())


@pytest.fixture(scope="module")
def lit():
    """A parsed scene by its number of lights."""
    sphere = example(1, size=SIZE)
    serialized = {lights: records.encode(under_lights(sphere, lights)) for lights in (1, 2, 3)}
    return {lights: records.parse(record, NAMES) for lights, record in serialized.items()}


def stacked(scene, name):
    """A feature under each light, `(L, …)`."""
    return np.array([scene[name], *records.decode(scene[records.FURTHER[name]])])


def seeds(count):
    return [tf.constant([seed, 5]) for seed in range(count)]


def many_weights(lights, count):
    """Draws of weights, `(count, L)`."""
    drawn = tf.data.Dataset.range(count).map(
        lambda seed: draw_weights(tf.constant(lights), tf.stack([seed, 7]))
    )
    return np.array(list(drawn.as_numpy_iterator()))


# The law of the weights.


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 20), st.integers(0, 2**31 - 1))
def test_weights_are_a_partition_of_1(lights, seed):
    weights = draw_weights(tf.constant(lights), tf.constant([seed, 0])).numpy()
    assert weights.shape == (lights,) and weights.dtype == np.float32
    assert (weights >= 0).all() and weights.sum() == pytest.approx(1, abs=1e-6)


def test_one_light_weighs_1_exactly():
    assert (many_weights(1, 50) == 1).all()


@pytest.mark.parametrize("lights", [2, 3, 5])
def test_each_number_and_choice_of_lights_is_equally_likely(lights):
    weights = many_weights(lights, 3000)
    taking_part = weights > 0
    number = taking_part.sum(axis=1)
    for count in range(1, lights + 1):
        # Some five standard deviations of 3,000 draws.
        assert abs((number == count).mean() - 1 / lights) < 0.045
        shares = taking_part[number == count].mean(axis=0)
        assert np.abs(shares - count / lights).max() < 0.11
    assert np.abs(weights.mean(axis=0) - 1 / lights).max() < 0.04


def test_two_lights_share_uniformly():
    weights = many_weights(2, 3000)
    first = weights[(weights > 0).all(axis=1), 0]
    assert 1300 < len(first) < 1700
    assert abs(first.mean() - 0.5) < 0.04 and abs(first.var() - 1 / 12) < 0.01
    assert first.min() < 0.01 and first.max() > 0.99


def test_three_lights_are_uniform_over_the_simplex():
    weights = many_weights(3, 6000)
    whole = weights[(weights > 0).all(axis=1)]
    # Variances of 1/18, and covariances of −1/36.
    expected = np.full((3, 3), -1 / 36) + np.eye(3) / 12
    np.testing.assert_allclose(np.cov(whole.T), expected, atol=0.008)


def test_a_strength_of_0_is_no_division_by_0(monkeypatch):
    monkeypatch.setattr(tf.random, "stateless_uniform", lambda shape, seed: tf.zeros(shape))
    weights = draw_weights(tf.constant(3), tf.constant([0, 0])).numpy()
    assert weights.tolist() == [1, 0, 0]


# Mixtures.


@pytest.mark.parametrize("lights", [1, 2, 3])
@pytest.mark.parametrize("seed", range(8))
def test_the_layers_are_the_weighted_sums(lit, lights, seed):
    scene = lit[lights]
    weights = draw_weights(tf.constant(lights), tf.constant([seed, 5])).numpy()
    found = relight(scene, tf.constant([seed, 5]))
    for name in records.LIT:
        expected = np.tensordot(weights, stacked(scene, name), 1)
        np.testing.assert_allclose(found[name], expected, rtol=1e-5, atol=1e-6, err_msg=name)
    for name in set(records.FEATURES) - set(records.LIT):
        assert np.array_equal(found[name], scene[name]), name
    assert set(found) == set(records.FEATURES)


def test_one_light_stays_bit_by_bit(lit):
    for seed in seeds(3):
        found = relight(lit[1], seed)
        for name in records.FEATURES:
            assert np.array_equal(found[name], lit[1][name]), name


def test_the_seed_decides_and_draws_variety(lit):
    found = [relight(lit[3], seed)["diffuse_shading"].numpy() for seed in seeds(12)]
    again = [relight(lit[3], seed)["diffuse_shading"].numpy() for seed in seeds(12)]
    np.testing.assert_array_equal(found, again)
    assert len({layer.tobytes() for layer in found}) > 8


def test_the_light_keeps_its_spherical_mean(lit):
    for seed in seeds(6):
        mixed = relight(lit[3], seed)["environment"].numpy()[..., 0]
        assert environment.spherical_mean(mixed) == pytest.approx(0.4, rel=0.02)


def test_some_features_are_mixed_as_in_the_whole(lit):
    whole = relight(lit[3], tf.constant([3, 5]))
    names = ("mirror", "further_mirror", "mask")
    some = relight({name: lit[3][name] for name in names}, tf.constant([3, 5]))
    assert set(some) == {"mirror", "mask"}
    np.testing.assert_array_equal(some["mirror"], whole["mirror"])
    assert set(relight({"mask": lit[3]["mask"]}, tf.constant([3, 5]))) == {"mask"}


def test_a_light_that_takes_no_part_is_not_decoded(lit):
    """Broken pictures tell."""
    broken = dict(lit[3])
    for name in records.FURTHER.values():
        broken[name] = tf.constant(["no picture", broken[name].numpy()[1]])
    used = 0
    for seed in seeds(12):
        takes_part = draw_weights(tf.constant(3), seed).numpy()[1] > 0
        used += takes_part
        if takes_part:
            with pytest.raises(tf.errors.InvalidArgumentError):
                relight(broken, seed)
        else:
            relight(broken, seed)
    assert 0 < used < 12


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.floats(0, 65504, width=16), min_size=1, max_size=6),
    st.integers(0, 2**31 - 1),
)
def test_a_mixture_lies_between_its_lights(radiances, seed):
    """Black ones and the brightest that half precision holds, too."""
    first, *others = np.array(radiances, np.float32)
    pngs = [records._half_png(np.full((2, 2, 1), radiance)) for radiance in others]
    scene = {
        "mirror": tf.fill((2, 2, 1), first),
        "further_mirror": tf.constant(pngs, tf.string),
    }
    found = relight(scene, tf.constant([seed, 0]))["mirror"].numpy()
    assert np.isfinite(found).all() and found.min() == found.max()
    slack = 1e-6 * max(radiances)
    assert min(radiances) - slack <= found.min() <= max(radiances) + slack


def test_records_tell_whether_they_hold_several_lights(lit):
    assert [bool(has_several_lights(lit[lights])) for lights in (1, 2, 3)] == [False, True, True]


# Pictures.


@pytest.mark.parametrize("seed", range(6))
def test_the_picture_is_eq_4_of_the_mixture(lit, seed):
    found = relight(lit[3], tf.constant([seed, 1]))
    image = recompose(found, lit[3]).numpy()
    composed = compose(
        found["diffuse_albedo"].numpy(),
        found["specular_albedo"].numpy(),
        found["ambient"].numpy(),
        found["diffuse_shading"].numpy()[None],
        found["specular_shading"].numpy()[None],
    )[0]
    inside = found["mask"].numpy()[..., 0] == 1
    level = colour.linear_to_srgb(np.clip(composed, 0, 1))
    np.testing.assert_allclose(image[inside], level[inside], atol=0.53 / 255)
    np.testing.assert_array_equal(image[~inside], lit[3]["image"].numpy()[~inside])
