"""What is given takes the place of estimates, for models and for tensors alike."""

import dataclasses

import keras
import numpy as np
import pytest
from scipy.special import softmax

from lime_keras.model import weights
from lime_keras.networks import assemble, build, output_names
from lime_keras.networks.registry import SUBNETWORKS
from lime_keras.networks.wiring import Wiring, required_inputs

SIZE = 32
LAYERS = {"mask": 1, "specular_shading": 1, "mirror": 1, "reflectance_map": 3}


@pytest.fixture(scope="module")
def given():
    """A photo and true layers, radiance also beside the object."""
    rng = np.random.default_rng(5)
    found = {name: rng.exponential(size=(2, SIZE, SIZE, c)) for name, c in LAYERS.items()}
    found |= {"image": rng.uniform(size=(2, SIZE, SIZE, 3)), "mask": np.clip(found["mask"], 0, 1)}
    return {name: value.astype(np.float32) for name, value in found.items()}


def run(network, *inputs):
    found = network(list(inputs) if len(inputs) > 1 else inputs[0])
    return list(map(np.array, found)) if isinstance(found, list) else np.array(found)


def answers(subnetworks, given):
    """What subnetworks answer that is not given, as arrays."""
    graph = Wiring(subnetworks, {name: keras.ops.convert_to_tensor(x) for name, x in given.items()})
    names = [name for name in output_names(subnetworks) if name not in given]
    return {name: np.array(graph.output(name)) for name in names}


def encoders(subnetworks):
    return {name: part for name, part in subnetworks.items() if SUBNETWORKS[name].encoder}


def test_the_encoders_read_what_is_given(tiny, given):
    part = encoders(build(tiny, seed=4))
    assert required_inputs(part) == ("mask", "specular_shading", "mirror")
    found = answers(part, {name: given[name] for name in ("image", *required_inputs(part))})
    mask = given["mask"]
    specular, mirror = (np.log1p(given[name]) * mask for name in ("specular_shading", "mirror"))
    albedos = np.clip(run(part["albedo"], given["image"] * mask, specular), 0, 1)
    expected = {
        "diffuse_albedo": albedos[:, :3],
        "specular_albedo": albedos[:, 3:],
        "exponent_bin_probabilities": softmax(run(part["exponent"], specular, mirror), axis=-1),
    }
    assert set(found) == set(expected)
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-4, atol=1e-5, err_msg=name)


def test_the_baselines_material_is_read_from_the_map_that_is_given(ablation, given):
    part = encoders(build(ablation, seed=1))
    if ablation.system == "lime":
        expected = ("mask", "specular_shading", *(["mirror"] if ablation.mirror else []))
        assert required_inputs(part) == expected
        return
    assert required_inputs(part) == ("mask", "reflectance_map")
    found = answers(part, {name: given[name] for name in ("image", "reflectance_map")})
    logits, albedos = run(part["material"], np.log1p(given["reflectance_map"]))
    np.testing.assert_allclose(found["diffuse_albedo"], np.clip(albedos, 0, 1)[:, :3], atol=1e-5)
    probabilities = softmax(logits, axis=-1)
    np.testing.assert_allclose(found["exponent_bin_probabilities"], probabilities, atol=1e-5)


def test_a_mask_that_is_given_is_an_input_and_no_output(tiny, given):
    subnetworks = build(tiny, seed=4)
    network = assemble(subnetworks, with_mask=True)
    assert {tensor.name for tensor in network.inputs} == {"image", "mask"}
    assert set(network.output) == set(output_names(subnetworks)) - {"mask"}
    with pytest.raises(ValueError, match=r"name at least one"):
        assemble(subnetworks, {"mask"}, with_mask=True)
    found = network({name: given[name] for name in ("image", "mask")})
    for name, value in answers(subnetworks, {n: given[n] for n in ("image", "mask")}).items():
        np.testing.assert_allclose(found[name], value, rtol=1e-4, atol=1e-5, err_msg=name)


@pytest.mark.parametrize("names", [{"mask"}, {"specular_shading"}, {"mask", "mirror"}])
def test_what_is_given_is_read(names, tiny, given):
    subnetworks = build(tiny, seed=4)
    inputs = {name: given[name] for name in ("image", *names)}
    found = answers(subnetworks, inputs)
    for name in names:
        changed = answers(subnetworks, inputs | {name: 0 * given[name]})
        assert any(not np.array_equal(changed[key], found[key]) for key in found), name


def test_a_plain_system_stretches_no_mask_and_exchanges_radiance(tiny, given):
    plain = dataclasses.replace(tiny, mask_contrast=False, linear=True)
    subnetworks = build(plain, seed=4)
    image = given["image"]
    mask = np.clip(run(subnetworks["segmentation"], image), 0, 1)
    specular = np.maximum(run(subnetworks["specular"], image * mask), 0) * mask
    mirror = np.maximum(run(subnetworks["mirror"], specular), 0) * mask
    logits = run(subnetworks["exponent"], specular, mirror)
    albedos = run(subnetworks["albedo"], image * mask, specular)
    expected = {
        "mask": mask,
        "specular_shading": specular,
        "mirror": mirror,
        "exponent_bin_probabilities": softmax(logits, axis=-1),
        "diffuse_albedo": np.clip(albedos[:, :3], 0, 1),
    }
    found = assemble(subnetworks)(image)
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-4, atol=1e-5, err_msg=name)
    # True radiance goes in as it is.
    inputs = {name: given[name] for name in ("image", "mask", "specular_shading")}
    true = answers({"mirror": subnetworks["mirror"]}, inputs)
    seen = given["specular_shading"] * given["mask"]
    expected = np.maximum(run(subnetworks["mirror"], seen), 0) * given["mask"]
    np.testing.assert_allclose(true["mirror"], expected, rtol=1e-4, atol=1e-5)


def test_what_is_given_replaces_no_answer(tiny, given):
    """A stage of SegmentationNet holds it to its loss, while the true mask cuts the object out."""
    subnetworks = build(tiny, seed=4)
    inputs = {name: keras.ops.convert_to_tensor(given[name]) for name in ("image", "mask")}
    graph = Wiring(subnetworks, inputs)
    found = run(subnetworks["segmentation"], given["image"])
    np.testing.assert_allclose(graph.raw_prediction("mask"), found, atol=1e-6)
    np.testing.assert_allclose(
        graph.output("mask"), np.clip((found - 0.5) * 1.5 + 0.5, 0, 1), atol=1e-6
    )
    np.testing.assert_array_equal(
        graph.network_input("masked_image"), given["image"] * given["mask"]
    )


def test_every_output_of_the_tiny_model_varies_with_the_image(tiny_model):
    """Many tests compare its outputs: those of a dead network would agree whatever was broken."""
    image = np.random.default_rng(0).uniform(size=(8, SIZE, SIZE, 3)).astype(np.float32)
    for name, value in assemble(weights.load(tiny_model)[1]).predict_on_batch(image).items():
        assert np.ptp(value, axis=0).max() > 1e-3, name
