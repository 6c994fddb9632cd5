"""The gloss in words, and the interval of the exponent."""

import numpy as np
import pytest

from lime_keras.optics import gloss, shininess


def test_words_change_at_edges_of_bins():
    words = [gloss.word(10.0**log) for log in shininess.LOG_MEANS]
    assert words == ["matte"] * 4 + ["satin", "semi-gloss", "glossy", "high-gloss"]
    assert gloss.word(0.0) == "matte" and gloss.word(1e9) == "high-gloss"


def test_a_sharp_lobe_of_no_strength_is_not_glossy_and_only_a_strong_one_mirrors():
    words = [gloss.word(900.0, specular) for specular in (0.0, 0.0005, 0.004, 0.04, 0.3)]
    assert words == ["matte", "matte", "semi-gloss", "high-gloss", "mirror-like"]
    assert gloss.word(30.0, 0.9) == "matte"


def test_the_likelier_side_is_said_and_how_likely_it_is():
    said = [gloss.describe(p, 100.0, 0.05) for p in (0.0, 0.15, 0.16, 0.4, 0.41, 0.59, 0.6, 0.85)]
    assert said == [
        *("matte or satin", "matte or satin", "rather matte (84 %)", "rather matte (60 %)"),
        *("satin to semi-gloss", "satin to semi-gloss", "rather glossy (60 %)", "glossy"),
    ]
    assert gloss.describe(0.95, 500.0, 0.05) == "high-gloss"
    assert gloss.describe(0.95, 200.0, 0.6) == "mirror-like"


def test_the_calibration_grows_with_the_level_and_never_overflows():
    calibration = gloss.Calibration(even=1.6, slope=3.0)
    likely = [calibration.probability(s, 0.05) for s in (0.0, 1.0, 10**1.6, 200.0, 1e30)]
    assert likely == sorted(likely) and likely[2] == pytest.approx(0.5)
    assert 0 <= likely[0] and likely[-1] <= 1
    assert calibration.probability(200.0, 0.001) < 0.5 < calibration.probability(200.0, None)
    assert gloss.Calibration(1.6, 1e9).probability(1.0, 0.05) < 1e-300


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


def test_an_exponent_is_never_told_bare():
    assert gloss.numbers(206.2, (45.7, 758.6)) == "s 206 (46 to 759)"
    assert gloss.numbers(9.96, None) == "s 10"
