"""Words for what is shown."""

import dataclasses

from lime_keras.eval.accuracy import labels


def test_bins_are_told_by_their_exponents():
    assert labels.bin_label(0) == "s 1–2.4" and labels.bin_label(7) == "s 421.7–1000"


def test_an_exponent_is_told_by_how_it_is_answered(tiny):
    regressed = dataclasses.replace(tiny, exponent="regression")
    assert "eight classes" in labels.exponent(tiny)
    assert "answers log10 s itself" in labels.exponent(regressed)
