"""Records: what goes in comes out, and what does not fit is refused by name, seed and index."""

import numpy as np
import pytest
import tensorflow as tf
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sphere_corpus import example

from lime_keras.data import records
from lime_keras.optics import environment

SIZE = 8
HALF_IMAGES = ("diffuse_shading", "specular_shading", "mirror", "normal", "environment")


@pytest.fixture
def sphere():
    return example(3, seed=0, size=SIZE)


def parsed(features):
    return {name: value.numpy() for name, value in records.parse(records.encode(features)).items()}


def altered(serialized, change):
    """The record after `change` had its protocol buffer."""
    message = tf.train.Example.FromString(serialized)
    change(message.features.feature)
    return message.SerializeToString(deterministic=True)


def test_round_trip(sphere):
    found = parsed(sphere)
    assert set(found) == set(records.FEATURES)
    for name in HALF_IMAGES:
        expected = np.asarray(sphere[name], np.float32).astype(np.float16).astype(np.float32)
        assert found[name].dtype == np.float32
        np.testing.assert_array_equal(found[name], expected, err_msg=name)
    for name in ("image", "mask"):
        assert found[name].dtype == np.float32
        np.testing.assert_allclose(found[name], sphere[name], atol=0.5 / 255 + 1e-6, err_msg=name)
        np.testing.assert_allclose(found[name] * 255, np.round(found[name] * 255), atol=1e-4)
    for name in ("camera", "diffuse_albedo", "specular_albedo", "shininess", "ambient"):
        np.testing.assert_array_equal(found[name], np.float32(sphere[name]), err_msg=name)
    assert (found["shape"], found["light"]) == (b"sphere", b"lamp")
    assert (found["seed"], found["index"]) == (0, 3)


def test_features_asked_for_are_decoded_alike_and_no_others(sphere):
    whole = parsed(sphere)
    for asked in (("mirror", "shape"), ("camera", "environment", "index"), ("ambient",)):
        found = records.parse(records.encode(sphere), asked)
        assert set(found) == set(asked)
        for name in asked:
            np.testing.assert_array_equal(found[name], whole[name])


def test_a_feature_that_records_lack_is_refused(sphere):
    with pytest.raises(ValueError, match="no depth, but image"):
        records.parse(records.encode(sphere), ("image", "depth"))


def test_what_was_parsed_encodes_to_the_same_bytes(sphere):
    once = records.encode(sphere)
    found = {name: value.numpy() for name, value in records.parse(once).items()}
    names = {name: found[name].decode() for name in ("shape", "light")}
    assert records.encode(found | names) == once


def test_same_example_same_bytes_whatever_its_order_and_precision(sphere):
    once = records.encode(sphere)
    assert records.encode(dict(reversed(sphere.items()))) == once
    single = {
        name: value.astype(np.float32) if isinstance(value, np.ndarray) else value
        for name, value in sphere.items()
    }
    assert records.encode(single | {"seed": np.int64(0)}) == once
    assert records.encode(sphere | {"index": 4}) != once


def test_every_half_float_survives(sphere):
    """All 31,744 that are finite and not negative, subnormal ones too."""
    values = np.arange(0x7C00, dtype=np.uint16).view(np.float16).astype(np.float32)
    shape = (*environment.STORED_SHAPE, 1)
    for part in np.split(np.resize(values, 4 * 8192), 4):
        found = parsed(sphere | {"environment": part.reshape(shape)})
        np.testing.assert_array_equal(found["environment"].reshape(-1), part)


@settings(max_examples=25)
@given(arrays(np.float32, (SIZE, SIZE, 1), elements=st.floats(0, 2.0**40, width=32)))
def test_radiance_keeps_three_digits_up_to_the_largest_half_float(radiance):
    found = parsed(example(3, size=SIZE) | {"mirror": radiance})["mirror"]
    kept = np.minimum(radiance, records.LARGEST_HALF)
    np.testing.assert_allclose(found, kept, rtol=2**-11, atol=2**-25)


def test_brighter_light_is_clipped(sphere):
    radiance = np.full((SIZE, SIZE, 1), 65504.0)
    radiance[0, :4, 0] = 65505, 65520, 1e30, 0
    found = parsed(sphere | {"specular_shading": radiance})["specular_shading"]
    assert found[0, 3] == 0 and found.max() == records.LARGEST_HALF
    assert (found[0, :3] == records.LARGEST_HALF).all()


def test_minus_zero_is_zero(sphere):
    zeros = np.zeros((SIZE, SIZE, 1))
    plus = records.encode(sphere | {"mirror": zeros, "normal": np.zeros((SIZE, SIZE, 3))})
    minus = records.encode(sphere | {"mirror": -zeros, "normal": -np.zeros((SIZE, SIZE, 3))})
    assert plus == minus
    assert not np.signbit(records.parse(minus)["mirror"]).any()


@pytest.mark.parametrize("value", [0.0, 1e-20, 1000.0, 1e30])
def test_extreme_exponents_survive(value, sphere):
    assert parsed(sphere | {"shininess": value})["shininess"] == np.float32(value)


@pytest.mark.parametrize("seed", [0, -1, 2**62])
def test_seeds_of_every_size_survive(seed, sphere):
    assert parsed(sphere | {"seed": seed})["seed"] == seed


def test_parsing_inside_tf_data_is_the_same(sphere):
    serialized = records.encode(sphere)
    [graph] = tf.data.Dataset.from_tensors(serialized).map(records.parse)
    for name, value in records.parse(serialized).items():
        np.testing.assert_array_equal(graph[name], value, err_msg=name)


# Refusals.


def refused(features, *words):
    with pytest.raises(ValueError) as caught:
        records.encode(features)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("name", records.FEATURES)
def test_a_missing_feature_is_named(name, sphere):
    del sphere[name]
    where = {"seed": "index 3", "index": "seed 0"}.get(name, "seed 0, index 3")
    refused(sphere, f"missing ['{name}']", where)


def test_an_unknown_feature_is_named(sphere):
    refused(sphere | {"colour": 1.0}, "unknown ['colour']", "seed 0, index 3")


IMAGES = ("image", "mask", "diffuse_shading", "specular_shading", "mirror", "normal", "environment")
SCALARS = ("specular_albedo", "shininess", "ambient")


@pytest.mark.parametrize("name", IMAGES)
@pytest.mark.parametrize("slicing", [np.s_[:-1], np.s_[:, 1:], np.s_[..., :0], np.s_[..., 0], 0])
def test_a_wrong_image_shape_is_named(name, slicing, sphere):
    refused(sphere | {name: np.asarray(sphere[name])[slicing]}, "has shape", "seed 0, index 3")


@pytest.mark.parametrize("name", [*IMAGES, "camera", "diffuse_albedo", *SCALARS])
def test_a_number_where_an_array_belongs_and_the_reverse_are_named(name, sphere):
    wrong = np.full((1,) if name in SCALARS else (), 0.5)
    refused(sphere | {name: wrong}, f"{name} has shape {wrong.shape}", "seed 0, index 3")


def test_images_that_are_not_square_or_empty_are_refused(sphere):
    arrays_ = {name: np.asarray(sphere[name]) for name in IMAGES[:-1]}
    refused(sphere | {name: value[:4] for name, value in arrays_.items()}, "has shape (4, 8, 3)")
    refused(
        sphere | {name: value[:0, :0] for name, value in arrays_.items()}, "has shape (0, 0, 3)"
    )


NUMBERS = [*IMAGES, "camera", "diffuse_albedo", *SCALARS]


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_named(name, value, sphere):
    broken = np.array(sphere[name], np.float32)
    broken.reshape(-1)[-1:] = value
    refused(sphere | {name: broken}, f"{name} is not finite", "seed 0, index 3")


@pytest.mark.parametrize("name", sorted(set(NUMBERS) - {"normal", "camera"}))
@pytest.mark.parametrize("value", [-0.5, 1.5])
def test_what_is_out_of_range_is_named(name, value, sphere):
    broken = np.array(sphere[name], np.float32)
    broken.reshape(-1)[-1:] = value
    if value > 1 and name not in ("image", "mask", "diffuse_albedo", "specular_albedo"):
        records.encode(sphere | {name: broken})
    else:
        refused(sphere | {name: broken}, f"{name} lies in", str(value), "seed 0, index 3")


def test_another_schema_is_refused(sphere):
    def renumber(features):
        features["schema"].int64_list.value[0] = records.SCHEMA_VERSION + 1

    serialized = altered(records.encode(sphere), renumber)
    with pytest.raises(tf.errors.InvalidArgumentError, match=r"another schema.*render"):
        records.parse(serialized)
    with pytest.raises(tf.errors.InvalidArgumentError, match=r"another schema.*render"):
        list(tf.data.Dataset.from_tensors(serialized).map(records.parse))


def test_bytes_that_are_no_example_are_refused(sphere):
    serialized = records.encode(sphere)
    for broken in (b"", b"nonsense", serialized[:-7]):
        # TensorFlow fails to decode its own message where that quotes the bytes.
        with pytest.raises((tf.errors.InvalidArgumentError, UnicodeDecodeError)):
            records.parse(broken)
    with pytest.raises(tf.errors.InvalidArgumentError, match="mirror"):
        records.parse(altered(serialized, lambda features: features.pop("mirror")))


def test_a_map_of_another_size_is_refused(sphere):
    def shrink(features):
        bits = tf.io.encode_png(np.zeros((32, 64, 1), np.uint16)).numpy()
        features["environment"].bytes_list.value[0] = bits

    with pytest.raises((tf.errors.InvalidArgumentError, ValueError)):
        records.parse(altered(records.encode(sphere), shrink))
