"""The split: by Eq. 4, the chroma of an object's pixels in grey light is D times that of m_d."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from keras import ops

from lime_keras.optics import colour, dichromatic
from lime_keras.optics.compositing import compose
from lime_keras.optics.dichromatic import with_hue_of_pixels

SHAPE = (3, 8, 9, 1)


def chroma(rgb):
    rgb = np.asarray(rgb, float)
    return rgb - rgb.mean(axis=-1, keepdims=True)


def scene(albedo, seed=0, brightness=0.3, specular=0.2):
    """Photos of objects of these albedos `(3, 3)` on all pixels."""
    rng = np.random.default_rng(seed)
    diffuse, glossy = rng.uniform(0.05, 1, (2, *SHAPE)) * brightness
    linear = compose(
        np.asarray(albedo, float), np.full(3, specular), np.full(3, 0.01), diffuse, glossy
    )
    return colour.linear_to_srgb(linear).astype(np.float32)


def albedos(seed, low=0.0):
    return np.random.default_rng(seed).uniform(low, 1, (3, 3)).astype(np.float32)


@given(st.integers(0, 2**31))
def test_the_hue_is_that_of_the_true_albedo(seed):
    true, estimate = albedos(seed), albedos(seed + 1)
    along, across = chroma(with_hue_of_pixels(estimate, scene(true, seed))), chroma(true)
    cosine = (along * across).sum(-1)
    lengths = np.linalg.norm(along, axis=-1), np.linalg.norm(across, axis=-1)
    # An albedo that is nearly grey shows no hue in 8 bits.
    known = lengths[1] > 0.02
    np.testing.assert_allclose(cosine[known], (lengths[0] * lengths[1])[known], atol=1e-3)


def test_grey_part_and_saturation_stay():
    estimate = albedos(2)
    found = with_hue_of_pixels(estimate, scene(albedos(3)))
    assert np.abs(found - estimate).max() > 0.1
    np.testing.assert_allclose(found.mean(-1), estimate.mean(-1), atol=1e-6)
    lengths = [np.linalg.norm(chroma(rgb), axis=-1) for rgb in (found, estimate)]
    np.testing.assert_allclose(*lengths, atol=1e-6)


def test_grey_pixels_no_pixels_and_clipped_pixels_tell_nothing():
    estimate, image = albedos(4), scene(albedos(5))
    grey = scene([[0.5, 0.5, 0.5]] * 3)
    for seen in (grey, 0 * image, 0 * image + 1, np.where([True, False, False], 1, image)):
        np.testing.assert_array_equal(with_hue_of_pixels(estimate, seen), estimate)


def test_clipped_pixels_and_pixels_outside_the_object_do_not_count():
    estimate, image = albedos(6), scene(albedos(7))
    expected = with_hue_of_pixels(estimate, image[:, 3:])
    for colour_there in ([1.0, 0.1, 0.1], [0.0, 0.0, 0.0]):
        partly = image.copy()
        partly[:, :3] = colour_there
        np.testing.assert_allclose(with_hue_of_pixels(estimate, partly), expected, atol=1e-6)


def test_tensors_as_arrays(differentiate):
    image, estimate = scene(albedos(9)), albedos(10)
    tensors = [ops.convert_to_tensor(value) for value in (estimate, image)]
    found = ops.convert_to_numpy(with_hue_of_pixels(*tensors))
    np.testing.assert_allclose(found, with_hue_of_pixels(estimate, image), atol=1e-6)
    for value in (estimate, np.full((3, 3), 0.5, np.float32), np.zeros((3, 3), np.float32)):
        _, [gradient] = differentiate(
            lambda albedo: ops.sum(with_hue_of_pixels(albedo, image)), value
        )
        assert np.isfinite(gradient).all()


def exact_split(image, mask):
    """The split by patches of one pixel, and nothing that keeps noise down."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"_PATCH": 1, "_DARK": 0.0, "_GREY": 0.0}.items():
            patch.setattr(dichromatic, name, value)
        return dichromatic.split(image, mask)


@given(
    st.tuples(*[st.floats(0.02, 1.0)] * 3).filter(lambda rgb: max(rgb) - min(rgb) > 0.05),
    st.floats(0.0, 1.0),
    st.integers(0, 2**31),
)
def test_a_pixel_without_gloss_gives_diffuse_and_grey_light_back(albedo, specular, seed):
    rng = np.random.default_rng(seed)
    shade, gloss = rng.uniform(0.2, 1.0, (2, 1, 8, 8, 1)) * 0.4
    gloss[0, 3, 5] = 0
    m_d, m_s = np.array([albedo]), np.array([specular])
    image = colour.linear_to_srgb(compose(m_d, m_s, np.zeros(1), shade, gloss))
    parts = exact_split(image, np.ones((1, 8, 8, 1)))
    np.testing.assert_allclose(parts.grey, specular * gloss, atol=1e-5)
    np.testing.assert_allclose(parts.diffuse, m_d.mean() * shade, atol=1e-5)
    np.testing.assert_allclose(parts.hue, chroma(m_d) / np.linalg.norm(chroma(m_d)), atol=1e-5)
    assert parts.trusted.item() == 1


def test_what_lies_outside_the_mask_does_not_matter():
    image = scene(albedos(11))
    mask = np.ones(SHAPE, np.float32)
    mask[:, :, 4:] = 0
    other = np.where(mask > 0, image, [0.7, 0, 0]).astype(np.float32)
    for one, two in zip(
        dichromatic.split(image, mask), dichromatic.split(other, mask), strict=True
    ):
        np.testing.assert_array_equal(one, two)
    assert not dichromatic.channels(image, mask)[:, :, 4:].any()


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("level", [0.0, 1e-6, 0.5, 1.0])
def test_without_colour_there_are_zeros_and_a_flag(dtype, level):
    image, mask = np.full((2, 8, 8, 3), level, dtype), np.ones((2, 8, 8, 1), dtype)
    mask[1] = 0
    parts = dichromatic.split(image, mask)
    for name in ("hue", "saturation", "diffuse", "trusted"):
        assert not getattr(parts, name).any(), name
    assert np.isfinite(parts.grey).all() and not parts.grey[1].any()
    assert np.isfinite(dichromatic.channels(image, mask)).all()


def test_one_pixel_is_enough_and_a_clipped_one_is_not():
    mask = np.zeros((2, 8, 8, 1), np.float32)
    mask[:, 2, 3] = 1
    image = np.full((2, 8, 8, 3), 0.5, np.float32)
    image[0, 2, 3], image[1, 2, 3] = [0.6, 0.4, 0.2], [1.0, 0.4, 0.2]
    parts = dichromatic.split(image, mask)
    assert parts.trusted[:, 0].tolist() == [1, 0]
    assert parts.diffuse[0, 2, 3] > 0.1 and np.isfinite(parts.grey).all()
    assert dichromatic.channels(image, mask)[1, 2, 3].tolist()[1:] == [0, 0, 1]


def test_light_of_a_second_colour_is_seen():
    rng = np.random.default_rng(3)
    shade, gloss = rng.uniform(0.1, 0.5, (2, 1024, 1))
    for tint, coloured in ((0.0, False), (0.5, True)):
        light = np.array([1 + tint, 1.0, 1 - tint])
        linear = np.array([0.2, 0.5, 0.3]) * shade + 0.5 * gloss * light
        second = dichromatic.second_colour(colour.linear_to_srgb(np.minimum(linear, 0.99)))
        assert (second > 0.1) == coloured
    assert dichromatic.second_colour(np.zeros((0, 3))) == 0


@pytest.mark.parametrize("level", [0.0, 1e-6, 0.5, 0.9989, 1.0])
@pytest.mark.parametrize("covered", [0.0, 1e-6, 0.5, 1.0])
def test_channels_of_tensors_and_their_gradients(differentiate, level, covered):
    rng = np.random.default_rng(5)
    image = (level * rng.uniform(0.9, 1, (2, 8, 8, 3))).astype(np.float32)
    mask = np.full((2, 8, 8, 1), covered, np.float32)
    found, gradients = differentiate(
        lambda photo, cut: ops.sum(dichromatic.channels(photo, cut)), image, mask
    )
    assert np.isclose(found, dichromatic.channels(image, mask).sum(), rtol=1e-4, atol=1e-3)
    assert all(np.isfinite(gradient).all() for gradient in gradients)
    half = dichromatic.channels(*(ops.convert_to_tensor(np.float16(one)) for one in (image, mask)))
    assert np.isfinite(ops.convert_to_numpy(half)).all()


def saturation(rgb):
    return float(1 - np.min(rgb) / np.max(rgb))


def painted(rgb, share=0.0, size=64, seed=0):
    """Return a picture of a colour under random shading, white on a share of it, and its mask."""
    shade = np.random.default_rng(seed).uniform(0.2, 0.9, (size, size, 1))
    linear = shade * np.array(rgb)
    linear[: round(share * size)] = 0.8 * shade[: round(share * size)]
    return colour.linear_to_srgb(linear).astype(np.float32), np.ones((size, size, 1), np.float32)


def test_a_dull_estimate_of_a_saturated_object_is_raised_to_its_pixels():
    true, dull = np.array([0.6, 0.2, 0.1]), np.array([0.45, 0.3, 0.25])
    found = dichromatic.with_saturation_of_pixels(dull, *painted(true))
    assert saturation(found) > 0.95 * saturation(true)
    assert found.mean() == pytest.approx(dull.mean()) and found.min() >= 0 and found.max() <= 1


@pytest.mark.parametrize(
    "estimate, rgb",
    [
        ((0.6, 0.2, 0.1), (0.5, 0.25, 0.15)),  # saturated already
        ((0.7, 0.68, 0.66), (0.6, 0.5, 0.4)),  # white in the light of a lamp
        ((0.3, 0.3, 0.3), (0.6, 0.2, 0.1)),  # grey: it has no hue to raise
    ],
)
def test_an_estimate_stays_where_the_pixels_do_not_show_more(estimate, rgb):
    estimate = np.array(estimate)
    np.testing.assert_array_equal(
        dichromatic.with_saturation_of_pixels(estimate, *painted(rgb)), estimate
    )


def test_too_few_pixels_or_two_hues_raise_nothing():
    dull = np.array([0.45, 0.3, 0.25])
    image, mask = painted([0.6, 0.2, 0.1])
    few = np.zeros_like(mask)
    few[:7, :9] = 1
    two = np.concatenate([image[:32], image[32:, :, ::-1]])
    for seen in ((image, few), (image, np.zeros_like(mask)), (two, mask)):
        np.testing.assert_array_equal(dichromatic.with_saturation_of_pixels(dull, *seen), dull)


def test_the_spread_of_colours_tells_a_second_material_from_a_highlight():
    inside = np.ones((64, 64), bool)
    spreads = [
        dichromatic.colour_spread(painted([0.5, 0.2, 0.1], share)[0], inside)
        for share in (0.0, 0.15, 0.45)
    ]
    assert spreads[0] < 0.02 and spreads[1] < 0.02 < 0.3 < spreads[2]
    assert dichromatic.colour_spread(painted([0.5, 0.2, 0.1])[0], ~inside) == 0
