"""Microfacet widths against the paper's formula, their limits and their order."""

import numpy as np
import pytest

from lime_keras.optics import microfacets


@pytest.mark.parametrize(
    "alpha, most", [(microfacets.beckmann_alpha, 1.0), (microfacets.ggx_alpha, 0.6)]
)
def test_it_falls_with_the_exponent(alpha, most):
    values = [float(alpha(exponent)) for exponent in (0.0, 1e-6, 1.0, 10.0, 1e3, 1e6)]
    assert values[0] == most and values[-1] > 0
    assert values == sorted(values, reverse=True) and len(set(values[2:])) == 4


def test_beckmanns_lobe_is_as_wide_as_the_exponents():
    """Where cos^(s + 2) has fallen to a half, exp(−tan² θ / α²) has, too, for narrow lobes."""
    exponent = np.array([30.0, 100.0, 1000.0])
    cosine = 0.5 ** (1 / (exponent + 2))
    tangent = np.sqrt(1 / cosine**2 - 1)
    fallen = np.exp(-((tangent / microfacets.beckmann_alpha(exponent)) ** 2))
    assert fallen == pytest.approx(np.full(3, 0.5), rel=0.02)


def test_the_inverse_that_the_benchmark_tells():
    """Other systems answer with these exponents (docs/reference/benchmark.md)."""
    alpha = np.array([0.02, 0.1, 0.5])
    assert microfacets.beckmann_alpha(2 / alpha**2 - 2) == pytest.approx(alpha)
    assert microfacets.ggx_alpha(2 * alpha**-1.6 - 2) == pytest.approx(alpha)
