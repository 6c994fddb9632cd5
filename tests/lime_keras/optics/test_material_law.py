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


@pytest.mark.parametrize("law", ["materials", "natural"])
def test_the_exponent_is_log_uniform_over_the_whole_range(law, request):
    logs = np.log10([m.exponent for m in request.getfixturevalue(law)])
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


@pytest.fixture(scope="module")
def natural():
    rng = np.random.default_rng(1)
    return [material_law.sample_material(rng, material_law.NATURAL) for _ in range(4000)]


def test_natural_materials_reflect_no_more_than_they_receive(natural):
    total = np.array([m.diffuse_albedo.max() + m.specular_albedo for m in natural])
    assert total.max() <= 1
    assert min(m.diffuse_albedo.min() for m in natural) >= 0
    assert min(m.specular_albedo for m in natural) > 0


def test_most_natural_materials_reflect_as_dielectrics_whatever_their_gloss(natural):
    specular = np.array([m.specular_albedo for m in natural])
    logs = np.log10([m.exponent for m in natural])
    for low in range(3):
        here = specular[(logs >= low) & (logs < low + 1)]
        # The reflectance of an index of 1.5 is 0.04 at normal incidence; half lie within a factor.
        assert 0.04 < np.median(here) < 0.06
        assert np.mean((here > 0.02) & (here < 0.1)) > 0.7


def test_the_strongly_specular_are_dark_and_more_often_glossy(natural):
    diffuse = np.array([m.diffuse_albedo.max() for m in natural])
    specular = np.array([m.specular_albedo for m in natural])
    glossy = np.array([m.exponent > 10**1.5 for m in natural])
    assert diffuse[specular > 0.5].max() < 0.1
    assert np.mean(specular[glossy] > 0.3) > 1.3 * np.mean(specular[~glossy] > 0.3) > 0


def test_a_table_of_natural_materials_is_sorted_and_as_they_are_drawn(natural):
    table = material_law.natural_table(4000)
    assert table.dtype == np.float32 and table.shape == (4000, 5)
    np.testing.assert_array_equal(table, material_law.natural_table(4000))
    assert (np.diff(table[:, 0]) > 0).all() and table[0, 0] == 0 and table[-1, 0] == 3
    specular = [m.specular_albedo for m in natural]
    assert stats.ks_2samp(table[:, 4], specular).pvalue > PLAUSIBLE
    bright = [m.diffuse_albedo.max() for m in natural]
    assert stats.ks_2samp(table[:, 1:4].max(axis=1), bright).pvalue > PLAUSIBLE
