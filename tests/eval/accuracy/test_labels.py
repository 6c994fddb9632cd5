"""Words for what is shown."""

import dataclasses

import pytest
from evaluations import LIME

from lime_keras.eval.accuracy import labels


def test_bins_are_told_by_their_exponents():
    assert labels.bin_label(0) == "s 1–2.4" and labels.bin_label(7) == "s 421.7–1000"


@pytest.mark.parametrize(
    "fields, which",
    [
        ({}, "ExponentNet and AlbedoNet given the true mask, S and M"),
        ({"mirror": False}, "ExponentNet and AlbedoNet given the true mask and S"),
        ({"system": "reflectance-map"}, "MaterialNet given the true reflectance map"),
    ],
)
def test_encoders_on_true_layers_are_called_what_they_are(fields, which):
    architecture = dataclasses.replace(LIME, **fields)
    assert labels.oracle(architecture).startswith("Same encoder")
    assert labels.oracle_is(architecture).startswith(f"{which}, as they are in the system")
