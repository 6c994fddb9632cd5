"""A material as JSON."""

import dataclasses
import json

import numpy as np
import pytest

from lime_keras import Material
from lime_keras.estimate import interchange
from lime_keras.material import Caution


@pytest.fixture
def material():
    return Material(
        diffuse_albedo=np.array([0.5, 0.25, 0.0], np.float32),
        specular_albedo=0.0,
        exponent=12.5,
        exponent_bin_probabilities=np.full(8, 0.125, np.float32),
        mask_coverage=0.0,
        exponent_entropy=3.0,
        layers={"mask": np.ones((2, 2, 1), np.float32)},
    )


def test_json_holds_every_number_and_no_layer(material):
    numbers = json.loads(json.dumps(material.to_json(), allow_nan=False))
    assert numbers == {
        "diffuse_albedo": [0.5, 0.25, 0.0],
        "specular_albedo": 0.0,
        "exponent": 12.5,
        "exponent_bin_probabilities": [0.125] * 8,
        "mask_coverage": 0.0,
        "exponent_entropy": 3.0,
        "exponent_interval": [1.99526, 501.187],
        "gloss": "matte or satin",  # m_s is 0
        "glossy_probability": pytest.approx(0, abs=1e-9),
        "roughness": 0.538449,
        "diffuse_srgb_hex": "#bc8900",
        "warnings": [],
    }
    told = dataclasses.replace(material, warnings=(Caution("too-dark", "light it"),))
    assert told.to_json() == numbers | {"warnings": [{"code": "too-dark", "message": "light it"}]}


def test_what_was_not_asked_for_is_left_out_and_zero_is_not(material):
    assert Material().to_json() == {"warnings": []}
    assert Material(mask_coverage=0.0).to_json() == {"mask_coverage": 0.0, "warnings": []}
    partial = dataclasses.replace(material, exponent=None, diffuse_albedo=None)
    assert not {"exponent", "diffuse_albedo"} & set(partial.to_json())


def test_a_regressed_exponent_has_no_probabilities_in_json(material):
    regressed = dataclasses.replace(
        material, exponent_bin_probabilities=None, exponent_entropy=None
    )
    numbers = {"diffuse_albedo", "specular_albedo", "exponent", "mask_coverage", "warnings"}
    derived = {"gloss", "glossy_probability", "roughness", "diffuse_srgb_hex"}
    assert set(regressed.to_json()) == numbers | derived
    assert regressed.gloss == "matte or satin"


def test_the_roughness_is_that_of_the_gltf_file(material):
    document = json.loads(interchange.gltf(material, "a"))
    told = document["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"]
    assert material.to_json()["roughness"] == told


def test_materials_cannot_be_changed_and_share_no_layers(material):
    with pytest.raises(dataclasses.FrozenInstanceError):
        material.exponent = 1.0
    Material().layers["mask"] = np.zeros(1)
    assert Material().layers == {}
