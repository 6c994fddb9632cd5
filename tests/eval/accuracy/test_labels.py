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
    for stage_one, short, how in (
        (("albedo", "exponent", "material"), "Stage-one encoder", "as before joined training"),
        ((), "Same encoder", "as they are in the system"),
    ):
        assert labels.oracle(architecture, stage_one).startswith(short)
        assert labels.oracle_is(architecture, stage_one).startswith(f"{which}, {how}")


def test_a_single_encoder_of_stage_one_does_not_lend_the_other_its_name():
    assert labels.oracle(LIME, ("albedo",)) == "Some stage-one encoders on true layers"
    told = labels.oracle_is(LIME, ("albedo",))
    assert told.startswith("AlbedoNet given the true mask, S and M, as before joined training")
    assert "and ExponentNet as they are in the system" in told
