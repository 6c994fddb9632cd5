"""The description that goes into every file."""

import dataclasses
import json

import numpy as np
import pytest

from lime_keras import __version__
from lime_keras.export import model_card
from lime_keras.networks import PRESETS, assemble, build, output_names
from lime_keras.optics import shininess


def test_it_says_what_the_network_takes_and_answers(tiny):
    card = model_card.card(tiny, assemble(build(tiny)), "int8")
    assert json.loads(json.dumps(card)) == card
    assert card["version"] == __version__ and card["precision"] == "int8"
    assert card["preset"] is None and card["architecture"] == dataclasses.asdict(tiny)
    assert card["input_shape"] == ["batch", 32, 32, 3]
    assert card["colour_space"] == "sRGB" and card["input_range"] == [0, 1]
    assert card["normalisation"] == "none"
    shapes = {name: output["shape"] for name, output in card["outputs"].items()}
    images = {key: ["batch", 32, 32, 1] for key in ("mask", "specular_shading", "mirror")}
    assert shapes == images | {
        "diffuse_albedo": ["batch", 3],
        "specular_albedo": ["batch", 1],
        "exponent_bin_probabilities": ["batch", 8],
    }
    edges = np.array(card["exponent_bin_edges"])
    assert edges[[0, -1]].tolist() == [1, 1000]
    means = np.array(card["exponent_bin_means"])
    assert shininess.bin_of(means).tolist() == list(range(8))
    np.testing.assert_allclose(means, np.sqrt(edges[1:] * edges[:-1]))


def test_another_lobe_has_other_units(tiny):
    plain, printed = (
        model_card.card(tiny, assemble(build(tiny)), "float32", lobe)
        for lobe in ("furnace", "printed")
    )
    changed = [name for name, one in printed["outputs"].items() if one != plain["outputs"][name]]
    assert (plain["lobe"], printed["lobe"]) == ("furnace", "printed")
    assert changed == ["specular_shading", "specular_albedo"]


def test_every_output_of_an_ablation_has_a_unit(ablation):
    subnetworks = build(ablation)
    card = model_card.card(ablation, assemble(subnetworks), "float32")
    assert tuple(card["outputs"]) == output_names(subnetworks)
    assert card["description"] == ablation.description
    classified = "exponent_bin_probabilities" in card["outputs"]
    assert ("exponent_bin_edges" in card) == ("exponent_bin_means" in card) == classified


BASELINE = {"system": "reflectance-map", "dichromatic": False, "hue": False}


@pytest.mark.parametrize("preset", PRESETS)
def test_a_preset_is_recognised_in_its_ablations(preset, tiny):
    network = assemble(build(tiny), ["mask"])
    for changed in ({}, {"mirror": False}, BASELINE):
        architecture = dataclasses.replace(PRESETS[preset], **changed)
        assert model_card.card(architecture, network, "float32")["preset"] == preset
