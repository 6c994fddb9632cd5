"""Eq. 4 against a loop over pixels."""

import numpy as np
import pytest

from lime_keras.optics.compositing import compose, diffuse_shading


def scene(batch=2, height=3, width=4, dtype=np.float64):
    rng = np.random.default_rng(0)
    m_d, m_s, m_a = (rng.uniform(size=shape) for shape in ((batch, 3), (batch, 1), (batch,)))
    shading = [rng.exponential(size=(batch, height, width, 1)) for _ in range(2)]
    return [value.astype(dtype) for value in (m_d, m_s, m_a, *shading)]


def test_composing_is_equation_4_at_every_pixel():
    m_d, m_s, m_a, diffuse, specular = scene()
    image = compose(m_d, m_s, m_a, diffuse, specular)
    assert image.shape == (2, 3, 4, 3)
    for b, y, x, c in np.ndindex(image.shape):
        expected = m_a[b] + m_d[b, c] * diffuse[b, y, x, 0] + m_s[b, 0] * specular[b, y, x, 0]
        assert image[b, y, x, c] == pytest.approx(expected)


def test_scalars_with_and_without_a_channel_axis():
    m_d, m_s, m_a, diffuse, specular = scene()
    image = compose(m_d, m_s, m_a, diffuse, specular)
    np.testing.assert_array_equal(compose(m_d, m_s[:, 0], m_a[:, None], diffuse, specular), image)


def test_the_diffuse_layer_over_its_albedo_is_the_shading():
    shade = np.random.default_rng(0).uniform(size=(4, 5, 1))
    albedo = np.array([0.2, 0.7, 0.05])
    assert diffuse_shading(shade * albedo, albedo) == pytest.approx(shade)
    assert diffuse_shading(shade * [0, 0.3, 0], np.array([0, 0.3, 0])) == (pytest.approx(shade))
    assert np.isnan(diffuse_shading(shade * 0.1 * np.ones(3), np.zeros(3))).all()
