"""The gloss in words, and the interval of the exponent."""

import numpy as np
import pytest

from lime_keras.optics import gloss, shininess


def test_a_word_covers_two_bins():
    words = [gloss.word(10.0**log) for log in shininess.LOG_MEANS]
    assert words == ["matte"] * 2 + ["satin"] * 2 + ["glossy"] * 2 + ["mirror-like"] * 2
    assert gloss.word(0.0) == "matte" and gloss.word(1e6) == "mirror-like"


@pytest.mark.parametrize("seed", range(5))
def test_the_interval_holds_the_central_share_of_draws(seed):
    rng = np.random.default_rng(seed)
    probabilities = rng.dirichlet(np.full(8, 0.5))
    bins = rng.choice(8, size=200_000, p=probabilities)
    drawn = 10 ** ((bins + rng.uniform(size=bins.size)) * shininess.BIN_WIDTH)
    low, high = gloss.interval(probabilities.astype(np.float32))
    assert np.mean(drawn < low) == pytest.approx(0.1, abs=0.005)
    assert np.mean(drawn > high) == pytest.approx(0.1, abs=0.005)


@pytest.mark.parametrize("bin_", [0, 3, 7])
def test_a_certain_bin_has_an_interval_inside_it(bin_):
    low, high = gloss.interval(np.eye(8)[bin_])
    assert [int(shininess.bin_of(s)) for s in (low, high)] == [bin_, bin_]
    assert np.log10(high / low) == pytest.approx(0.8 * shininess.BIN_WIDTH)


def test_bins_without_probability_are_passed_over():
    low, high = gloss.interval(np.array([0, 0.5, 0, 0, 0, 0, 0.5, 0]))
    assert [int(shininess.bin_of(s)) for s in (low, high)] == [1, 6]


def test_only_where_the_bins_are_nearly_flat_a_range_is_told():
    flat, peak = np.full(8, 0.125), np.array([0, 0.05, 0.2, 0.5, 0.2, 0.05, 0, 0])
    assert gloss.in_words(32.0, gloss.interval(flat)) == "uncertain: matte to mirror-like"
    assert gloss.in_words(20.0, gloss.interval(peak)) == "satin"
    edge = 10.0 ** np.array([0.5, 0.5 + gloss.FLAT])
    assert gloss.is_flat(edge * [1, 1.001]) and not gloss.is_flat(edge * [1, 0.999])


def test_an_exponent_is_never_told_bare():
    assert gloss.sentence(31.6, (2.0, 501.2)) == (
        "gloss uncertain: matte to mirror-like, s 32 (2.0 to 501)"
    )
    assert gloss.sentence(206.2, (45.7, 758.6)) == "mirror-like, s 206 (46 to 759)"
    assert gloss.sentence(9.96, None) == "satin, s 10"
