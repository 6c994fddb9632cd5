"""Reflectance maps: against the sums over the light's texels, by closed forms, at the extremes."""

import functools

import numpy as np
import pytest

from lime_keras.optics import environment, shading
from lime_keras.optics.reflectance_map import disc, true_reflectance_map

SHAPE = environment.STORED_SHAPE


@functools.cache
def _compiled():
    import tensorflow as tf

    return tf.function(true_reflectance_map)


def _batch(maps, exponents, m_d=(0.0, 0.0, 0.0), m_s=0.0, m_a=0.0, size=32):
    """A batch with a list of lights `(64, 128)`."""
    count = len(maps)
    batch = {
        "environment": np.stack(maps)[..., None],
        "shininess": np.broadcast_to(exponents, count),
        "diffuse_albedo": np.broadcast_to(m_d, (count, 3)),
        "specular_albedo": np.broadcast_to(m_s, count),
        "ambient": np.broadcast_to(m_a, count),
        "mask": np.zeros((count, size, size, 1)),
    }
    return {name: array.astype(np.float32) for name, array in batch.items()}


def _drawn(*arguments, **options):
    """Maps of the batch of these arguments, compiled, as an array `(B, size, size, 3)`."""
    return _compiled()(_batch(*arguments, **options)).numpy()


def _diffuse(maps, size=32):
    return _drawn(maps, 1.0, m_d=(1.0, 1.0, 1.0), size=size)[..., 0]


def _specular(maps, exponents, size=32):
    return _drawn(maps, exponents, m_s=1.0, size=size)[..., 0]


def _normals(size):
    """Normals `(N, 3)` of the pixels on the sphere, and where they are."""
    centres = (2 * np.arange(size) + 1) / size - 1
    u, v = np.meshgrid(centres, -centres)
    on = u**2 + v**2 <= 1
    return np.stack([u, v, np.sqrt(np.maximum(1 - u**2 - v**2, 0))], axis=-1)[on], on


def _lamp(direction, radiance, sky):
    """One texel of the given radiance under an even sky."""
    light = environment.directions(*SHAPE)
    out = np.full(SHAPE, float(sky))
    out[np.unravel_index(np.argmax(light @ np.asarray(direction, float)), SHAPE)] = radiance
    return out


def _room():
    """Light that varies smoothly, and vanishes in places."""
    x, y, z = np.moveaxis(environment.directions(*SHAPE), -1, 0)
    return np.maximum(1 + np.sin(3 * x + 1) * np.cos(2 * y) + 0.5 * z, 0)


@pytest.mark.parametrize("size", [1, 2, 33, 64])
def test_the_disc_is_where_the_centres_show_the_sphere(size):
    _, on = _normals(size)
    mask = disc(size)
    assert mask.shape == (size, size, 1) and mask.dtype == np.float32
    np.testing.assert_array_equal(mask[..., 0], on)


def test_a_furnace_is_one():
    exponents = np.array([0, 1, 2.37, 10, 100, 1000])
    maps = [np.ones(SHAPE)] * len(exponents)
    on = disc(33)[..., 0] > 0
    np.testing.assert_allclose(_diffuse(maps, size=33)[:, on], 1, rtol=2e-3)
    # An odd size has a pixel at n = o.
    specular = _specular(maps, exponents, size=33)
    np.testing.assert_allclose(specular[:, 16, 16], 1, rtol=5e-3)
    assert (specular[:, ~on] == 0).all()


@pytest.mark.parametrize("exponent", [0, 1.5, 10, 100, 1000])
@pytest.mark.parametrize(
    "light",
    [
        _room(),
        _lamp([0.6, 0.5, 0.62], 100, 1),
        _lamp([-0.3, 0.8, -0.5], 100, 1),
        _lamp([0, 0, 1], 100, 1),
    ],
    ids=["room", "in front", "behind", "at the viewer"],
)
def test_the_map_agrees_with_the_sums_over_texels(light, exponent):
    normal, on = _normals(32)
    view = np.broadcast_to([0.0, 0.0, 1.0], normal.shape)
    texels = shading.texels(light)
    for drawn, exact in (
        (_diffuse([light]), shading.diffuse(normal, *texels)),
        (_specular([light], exponent), shading.specular(normal, view, exponent, *texels)),
    ):
        error = np.abs(drawn[0][on] - exact)
        assert np.median(error / exact) < 2e-3
        # What is left lies where a lamp rises over the horizon, and at the foot of highlights.
        assert np.percentile(error, 95) < 0.015 * exact.max()


@pytest.mark.parametrize("exponent", [30.0, 300.0, 1000.0])
def test_the_peak_of_a_highlight_is_where_and_what_it_should_be(exponent):
    lights = [_lamp(np.array([x, 0.3, 0.6]), 1e4, 0) for x in np.linspace(-0.7, 0.7, 5)]
    normal, on = _normals(64)
    view = np.broadcast_to([0.0, 0.0, 1.0], normal.shape)
    for light, drawn in zip(lights, _specular(lights, exponent, size=64), strict=True):
        exact = shading.specular(normal, view, exponent, *shading.texels(light))
        assert np.argmax(drawn[on]) == np.argmax(exact)
        assert drawn.max() == pytest.approx(exact.max(), rel=0.03)


def test_a_lamp_darkens_nothing():
    """Interpolation must not ring into a dark halo around a highlight."""
    lights = [_lamp([0.6, 0.5, 0.62], radiance, 1) for radiance in (1, 1000)]
    sky, lit = _specular(lights, 1000.0, size=64)[:, disc(64)[..., 0] > 0]
    assert (lit > 0.95 * sky).all()


def test_each_example_is_the_sum_of_its_layers():
    """Eq. 4, with a material and a light of each example's own."""
    maps, exponents = [_room(), _lamp([0.5, 0.5, 0.7], 50, 1)], np.array([7.0, 300.0])
    m_d = np.array([[0.1, 0.5, 0.9], [0.3, 0.2, 0.0]])
    m_s, m_a = np.array([0.8, 0.3]), np.array([0.05, 0.0])
    drawn = _drawn(maps, exponents, m_d, m_s, m_a)
    layers = (
        m_a[:, None, None, None]
        + m_d[:, None, None, :] * _diffuse(maps)[..., None]
        + m_s[:, None, None, None] * _specular(maps, exponents)[..., None]
    )
    np.testing.assert_allclose(drawn, layers * disc(32), rtol=1e-5, atol=1e-6)


def test_exponents_above_the_range_count_as_its_end():
    light = [_lamp([0.3, 0.2, 0.9], 100, 1)]
    np.testing.assert_array_equal(_specular(light, 1e4), _specular(light, 1e3))


def test_arrays_and_compiled_tensors_agree():
    lights = np.stack([_room(), _lamp([0.5, 0.5, 0.7], 50, 1), 0 * _room()]).astype(np.float32)
    exponents = np.array([20, 400, 1], np.float32)
    m_d, ones = np.tile(np.array([1, 0.5, 0], np.float32), (3, 1)), np.ones(3, np.float32)
    arrays = true_reflectance_map(_batch(lights, exponents, m_d, ones, 0 * ones, size=16))
    assert isinstance(arrays, np.ndarray) and arrays.dtype == np.float32
    compiled = _drawn(lights, exponents, m_d, ones, 0 * ones, size=16)
    np.testing.assert_allclose(arrays, compiled, rtol=1e-5, atol=1e-6)
    one = true_reflectance_map(_batch(lights[:1], exponents[:1], m_d[:1], ones[:1], size=16))
    np.testing.assert_allclose(one, arrays[:1], rtol=1e-5, atol=1e-6)
