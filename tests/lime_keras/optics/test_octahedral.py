"""Octahedral codes: what comes back, how near, and what has no direction."""

import keras
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lime_keras.optics import octahedral


def unit(count, seed=0):
    """Directions spread evenly over the sphere."""
    vectors = np.random.default_rng(seed).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def angle(a, b):
    """In degrees, exact for small angles too."""
    return np.degrees(2 * np.arcsin(np.linalg.norm(a - b, axis=-1) / 2))


def test_the_axes_come_back_exactly():
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    np.testing.assert_array_equal(octahedral.decode(octahedral.encode(axes)), axes)


def test_any_direction_comes_back_within_six_hundredths_of_a_degree():
    directions = unit(200_000)
    off = angle(octahedral.decode(octahedral.encode(directions)), directions)
    assert off.max() < 0.06 and off.mean() < 0.0211
    assert off.mean() > 0.015  # so the bounds above tell of these codes, and not of finer ones


def test_decoded_normals_have_length_one_whatever_the_codes():
    codes = np.stack(np.meshgrid(*[np.arange(0, octahedral.LARGEST + 1, 7)] * 2), axis=-1)
    decoded = octahedral.decode(codes.astype(np.uint16))
    assert decoded.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(decoded, axis=-1), 1, atol=2e-7)


def test_codes_survive_being_decoded():
    """But those on the square's border, where two codes mean one direction."""
    codes = np.stack(np.meshgrid(*[np.arange(1, octahedral.LARGEST, 13)] * 2), axis=-1)
    again = octahedral.encode(octahedral.decode(codes.astype(np.uint16)))
    assert again.dtype == np.uint16
    np.testing.assert_array_equal(again, codes)


@given(arrays(float, 3, elements=st.floats(-1e6, 1e6)).filter(lambda v: np.abs(v).max() > 1e-6))
def test_the_length_of_a_vector_does_not_matter(vector):
    there = octahedral.decode(octahedral.encode(vector))
    assert angle(there, vector / np.linalg.norm(vector)) < 0.06


def test_a_tensor_is_decoded_as_an_array_is():
    codes = octahedral.encode(unit(1000).reshape(10, 100, 3))
    decoded = octahedral.decode(keras.ops.convert_to_tensor(codes))
    np.testing.assert_allclose(np.asarray(decoded), octahedral.decode(codes), atol=1e-6)


@pytest.mark.parametrize("broken", [0.0, np.nan, np.inf])
def test_what_has_no_direction_is_refused(broken):
    vectors = unit(5)
    vectors[3] = broken
    with pytest.raises(ValueError, match="no direction"):
        octahedral.encode(vectors)


def test_no_vectors_have_no_codes():
    assert octahedral.encode(np.zeros((0, 3))).shape == (0, 2)
    assert octahedral.decode(np.zeros((0, 2), np.uint16)).shape == (0, 3)
