"""Materials: each quantity is drawn from the distribution that the paper states."""

import numpy as np
import pytest
from scipy import stats

from lime_keras.optics import material_law, shininess

PLAUSIBLE = 1e-3  # p-value, at fixed seeds


@pytest.fixture(scope="module")
def materials():
    rng = np.random.default_rng(0)
    return [material_law.sample_material(rng) for _ in range(4000)]


def test_every_shininess_bin_is_as_likely(materials):
    bins = shininess.bin_of(np.array([m.exponent for m in materials]))
    counts = np.bincount(bins, minlength=shininess.BIN_COUNT)
    assert len(counts) == 8 and stats.chisquare(counts).pvalue > PLAUSIBLE


def test_the_exponent_is_log_uniform_over_the_whole_range(materials):
    logs = np.log10([m.exponent for m in materials])
    assert stats.kstest(logs, stats.uniform(0, 3).cdf).pvalue > PLAUSIBLE


def test_the_numbers_are_uniform_in_their_ranges(materials):
    specular = [m.specular_albedo for m in materials]
    ambient = [m.ambient for m in materials]
    assert stats.kstest(specular, stats.uniform(0, 1).cdf).pvalue > PLAUSIBLE
    assert stats.kstest(ambient, stats.uniform(0, 0.05).cdf).pvalue > PLAUSIBLE


def test_albedos_are_uniform_in_the_colours_cube(materials):
    """YUV is linear in RGB: uniform in the one, within the cube, is uniform in the other."""
    albedo = np.array([m.diffuse_albedo for m in materials])
    assert albedo.min() >= 0 and albedo.max() <= 1
    for channel in albedo.T:
        assert stats.kstest(channel, stats.uniform(0, 1).cdf).pvalue > PLAUSIBLE
    np.testing.assert_allclose(np.cov(albedo.T), np.eye(3) / 12, atol=0.006)


def test_nothing_is_drawn_together(materials):
    table = [
        [*m.diffuse_albedo, m.specular_albedo, np.log(m.exponent), m.ambient] for m in materials
    ]
    correlation = np.corrcoef(np.transpose(table)) - np.eye(6)
    assert np.abs(correlation).max() < 0.06


def test_a_material_is_a_function_of_the_generator():
    first, again, other = (
        material_law.sample_material(np.random.default_rng(k)) for k in (0, 0, 1)
    )
    assert first.exponent == again.exponent != other.exponent
    np.testing.assert_array_equal(first.diffuse_albedo, again.diffuse_albedo)
