"""Each loss by hand, as compaction, and finite with finite gradients at the extremes."""

import numpy as np
import pytest
from keras import ops

from lime_keras import losses
from lime_keras.optics import colour
from lime_keras.optics.compositing import compose
from lime_keras.optics.dynamic_range import compress

SHAPE = (2, 4, 5)
SQUARABLE = 1e15  # Adam squares gradients in float32


def uniform(*shape, seed=0, high=1.0):
    return np.random.default_rng(seed).uniform(0, high, shape).astype(np.float32)


def masks():
    one = np.zeros((*SHAPE, 1), np.float32)
    one[:, 1, 2] = 1
    faint = np.zeros_like(one)
    faint[:, 1, 2] = 1 / 255
    half = (uniform(*SHAPE, 1, seed=5) > 0.5).astype(np.float32)
    return {
        "empty": np.zeros_like(one),
        "one pixel": one,
        "faint": faint,
        "half": half,
        "full": np.ones_like(one),
    }


def check(value, gradients):
    assert value.shape == SHAPE[:1] and np.isfinite(value).all() and (value >= 0).all()
    for gradient in gradients:
        assert np.isfinite(gradient).all() and np.abs(gradient).max() < SQUARABLE


def photo(image=None, mask=None, m_d=None, m_s=None, m_a=0.02, diffuse=None, specular=None):
    """The arguments of the compositing loss: an object whose image is exact unless told."""
    m_d = uniform(2, 3, seed=1) * 0.3 if m_d is None else np.full((2, 3), m_d, np.float32)
    m_s = uniform(2, 1, seed=2) * 0.3 if m_s is None else np.full((2, 1), m_s, np.float32)
    m_a = np.full(2, m_a, np.float32)
    diffuse = uniform(*SHAPE, 1, seed=3) if diffuse is None else diffuse
    specular = uniform(*SHAPE, 1, seed=4) if specular is None else specular
    mask = np.ones((*SHAPE, 1), np.float32) if mask is None else mask
    if image is None:
        image = colour.linear_to_srgb(np.clip(compose(m_d, m_s, m_a, diffuse, specular), 0, 1))
    return [image, mask, m_d, m_s, m_a, diffuse, compress(specular)]


def compositing_l1(image, *others):
    """Our Eq. 5 of a photo of its own size: clipped is what is as bright as that."""
    return losses.compositing_l1(image, *others, ops.cast(image >= colour.CLIPPED, "float32"))


# What each loss says.


def test_mask_structure_is_least_for_the_true_mask(differentiate):
    mask = masks()["half"]
    values = [
        differentiate(losses.mask_structure, mask, found)[0]
        for found in (30 * mask - 15, mask, np.full_like(mask, 0.5), 1 - mask, 15 - 30 * mask)
    ]
    assert (np.diff(values, axis=0) > 0).all() and (values[0] < 1e-5).all()


def test_mask_structure_weighs_thin_parts(differentiate):
    """A line that is missed costs more than as many pixels of a square."""
    thin, square = np.zeros((2, 1, 32, 32, 1), np.float32)
    thin[0, 8:24, 16], square[0, 14:18, 14:18] = 1, 1
    block = np.zeros_like(thin)
    block[0, 4:28, 4:12] = 1
    lost = [
        differentiate(losses.mask_structure, np.maximum(block, part), 2 * block - 0.5)[0][0]
        for part in (thin, square)
    ]
    assert lost[0] > 1.02 * lost[1]


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_mask_structure_at_one_half_pulls_to_the_mask_as_beside_it(level, differentiate):
    mask = np.full((*SHAPE, 1), level, np.float32)
    at, beside = (
        differentiate(losses.mask_structure, mask, np.full_like(mask, p))[1][1]
        for p in (0.5, 0.5 + 1e-4)
    )
    np.testing.assert_allclose(at, beside, rtol=1e-3)
    assert (np.sign(at) == (1 if level == 0 else -1)).all()


def test_mask_structure_without_an_object_is_zero_for_nothing(differentiate):
    mask = masks()["empty"]
    value, [_, gradient] = differentiate(losses.mask_structure, mask, np.full_like(mask, -9))
    assert (np.abs(value) < 1e-6).all() and (gradient >= 0).all()


@pytest.mark.parametrize("shape", [(1,), (3,), (4, 5, 1)])
def test_squared_is_the_mean_square_and_absolute_flat_at_the_truth(shape, differentiate):
    true, predicted = uniform(5, *shape), uniform(5, *shape, seed=1)
    error, axes = predicted - true, tuple(range(1, len(shape) + 1))
    value, _ = differentiate(losses.squared, true, predicted)
    np.testing.assert_allclose(value, np.square(error).mean(axes), rtol=1e-5)
    assert (differentiate(losses.squared, true, true)[0] == 0).all()
    value, [_, gradient] = differentiate(losses.absolute, true, predicted)
    np.testing.assert_allclose(value, np.abs(error).mean(axes), rtol=1e-5)
    np.testing.assert_allclose(gradient, np.sign(error) / np.prod(shape), rtol=1e-5)
    value, [_, gradient] = differentiate(losses.absolute, true, true)
    assert (value == 0).all() and (gradient == 0).all()


def test_binary_cross_entropy_is_that_of_the_one_hot_bins(differentiate):
    bins, logits = np.array([1, 7]), uniform(2, 8, high=4.0)
    value, [gradient] = differentiate(
        lambda x: losses.exponent_binary_cross_entropy(bins, x), logits
    )
    p = np.exp(np.float64(logits))
    p /= p.sum(-1, keepdims=True)
    true = np.eye(8)[bins]
    expected = -(true * np.log(p) + (1 - true) * np.log(1 - p)).mean(-1)
    np.testing.assert_allclose(value, expected, rtol=1e-5)
    check(value, [gradient])


@pytest.mark.parametrize("lead", [20.0, 100.0, 1e4])
def test_binary_cross_entropy_goes_on_teaching_and_of_certainty_is_zero(lead, differentiate):
    logits = np.zeros((2, 8), np.float32)
    logits[:, 3] = lead
    value, [gradient] = differentiate(
        lambda x: losses.exponent_binary_cross_entropy(np.array([3, 4]), x), logits
    )
    check(value, [gradient])
    assert value[0] == pytest.approx(0, abs=1e-6)
    assert value[1] == pytest.approx(2 * lead / 8, rel=0.1) and gradient[1, 3] > 0.1


@pytest.mark.parametrize("name", masks())
def test_the_printed_eq_5_is_the_mean_square_of_the_masked_residual(name, differentiate):
    """Over all of B: clipped channels and partly covered pixels count as any."""
    image, mask = uniform(*SHAPE, 3, seed=8), masks()[name]
    image[:, 0] = 1.0
    arguments = photo(image, mask)
    value, gradients = differentiate(losses.compositing_l2, *arguments)
    _, _, m_d, m_s, m_a, diffuse, specular = arguments
    composed = compose(m_d, m_s, m_a, diffuse, np.expm1(specular))
    residual = mask * (colour.srgb_to_linear(image) - composed)
    np.testing.assert_allclose(value, np.square(residual).mean((1, 2, 3)), rtol=1e-4, atol=1e-9)
    check(value, gradients)


def test_linear_shading_is_compared_as_radiance(differentiate):
    true, predicted = uniform(*SHAPE, 1, high=9.0), uniform(*SHAPE, 1, seed=1)
    full = masks()["full"]
    value, _ = differentiate(lambda x: losses.shading_l1(true, x, full, True), predicted)
    np.testing.assert_allclose(value, np.abs(predicted - true).mean((1, 2, 3)), rtol=1e-5)


def test_compositing_of_the_truth_is_zero(differentiate):
    value, _ = differentiate(compositing_l1, *photo())
    np.testing.assert_allclose(value, 0, atol=1e-6)


def test_compositing_is_compaction_over_fully_covered_pixels(differentiate):
    mask = masks()["half"] * np.float32(0.9)
    mask[:, :2] = masks()["half"][:, :2]
    arguments = photo(image=uniform(*SHAPE, 3, seed=9, high=0.9), mask=mask)
    value, _ = differentiate(compositing_l1, *arguments)
    image, _, m_d, m_s, m_a, diffuse, compressed = arguments
    composed = compose(m_d, m_s, m_a, diffuse, np.expm1(compressed))
    for b in range(2):
        covered = mask[b, ..., 0] == 1
        expected = np.abs(composed[b][covered] - colour.srgb_to_linear(image[b][covered]))
        assert value[b] == pytest.approx(expected.mean(), rel=1e-4)


# One-sided where the camera clipped.


def test_channels_are_clipped_one_by_one(differentiate):
    arguments = photo(m_d=0.0, m_s=0.0, m_a=2.0, image=np.full((*SHAPE, 3), 0.5, np.float32))
    arguments[0][..., 0] = 1.0
    value, _ = differentiate(compositing_l1, *arguments)
    distance = 2 - colour.srgb_to_linear(np.float32(0.5))
    np.testing.assert_allclose(value, 2 / 3 * distance, rtol=1e-5)


# Extremes.


@pytest.mark.parametrize("name", masks())
def test_an_empty_mask_costs_nothing_and_teaches_nothing(name, differentiate):
    mask = masks()[name]
    shading = differentiate(losses.shading_l1, uniform(*SHAPE, 1), uniform(*SHAPE, 1, seed=1), mask)
    image = uniform(*SHAPE, 3, seed=9)
    composed = differentiate(compositing_l1, *photo(image=image, mask=mask))
    assert (shading[0] == 0).all() == (name == "empty")
    # A faint pixel shows mostly background.
    assert (composed[0] == 0).all() == (name in ("empty", "faint"))
    if name == "empty":
        assert (shading[1][1] == 0).all()
        assert all((gradient == 0).all() for gradient in composed[1][2:])


def test_the_truth_costs_little_after_the_photo_was_made_smaller():
    """Highlights clipped in a part of a pixel are a lower bound there, not an observation."""
    import tensorflow as tf
    from sphere_corpus import COMPOSED, example

    from lime_keras.data import pipeline, records

    for index in range(6):
        truth = pipeline.resize(records.parse(records.encode(example(index))), 32)
        batch = {name: tf.expand_dims(value, 0) for name, value in truth.items()}
        layers, specular = [batch[name] for name in COMPOSED], compress(batch["specular_shading"])
        assert losses.compositing_l1(*layers, specular, batch["clipped"]) < 2e-3
