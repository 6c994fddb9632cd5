"""Words for what is shown."""

from lime_keras.eval.accuracy import labels


def test_bins_are_told_by_their_exponents():
    assert labels.bin_label(0) == "s 1–2.4" and labels.bin_label(7) == "s 421.7–1000"
