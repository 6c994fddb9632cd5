"""The sets of weights that come with the package."""

import keras
import numpy as np
import pytest
from keras import ops
from whole_engines import Network

from lime_keras import Estimator
from lime_keras.export import parity
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.model.folder import PRETRAINED
from lime_keras.networks import assemble
from lime_keras.networks.precision import computing_in
from lime_keras.optics import dichromatic
from lime_keras.runtime.onnx_graphs import OnnxGraphs

SETS = model_folder.shipped()
# What follows from the weights alone: the smallest set stands for all until one is shipped anew.
ONE_IS_QUICK = [
    pytest.param(name, marks=() if name == "nano" else pytest.mark.slow) for name in SETS
]


def size(*folders):
    """Bytes of all files in folders."""
    files = (path for folder in folders for path in folder.rglob("*") if path.is_file())
    return sum(path.stat().st_size for path in files)


def test_all_sets_together_are_small():
    assert model_folder.DEFAULT.name in SETS
    assert size(*SETS.values()) < 58e6


@pytest.mark.parametrize("name", SETS)
def test_a_set_is_whole_described_and_there_once(name):
    held = {path.name for path in SETS[name].rglob("*") if path.is_file()}
    assert {"lime.json", "training.json"} <= held
    assert f"## `{name}`" in (PRETRAINED / "README.md").read_text(encoding="utf-8")
    assert model_folder.has_weights_in_graphs(SETS[name])
    description = model_folder.read_description(model_folder.graphs(SETS[name]))
    assert description is not None and description.weights == model_folder.digest(SETS[name])


@pytest.mark.parametrize("name", ONE_IS_QUICK)
def test_its_graphs_answer_what_keras_answers(name):
    """After a change of what connects the subnetworks: `make graphs`."""
    folder = model_folder.graphs(SETS[name])
    description = model_folder.read_description(folder)
    engine, images = OnnxGraphs(folder, description), parity.images(description.size)
    architecture, subnetworks = weights.load(SETS[name])
    assert architecture.system == "lime" and architecture.hue and len(subnetworks) == 5
    expected = parity.predictions(Network(assemble(subnetworks)), images)
    found = parity.predictions(engine, images)
    parity.check(expected, found, "float32")


@pytest.mark.parametrize("name", ONE_IS_QUICK)
def test_it_answers_in_half_precision(name):
    with computing_in("float16"):
        architecture, subnetworks = weights.load(SETS[name])
    found = parity.predictions(Network(assemble(subnetworks)), parity.images(architecture.size))
    for output, value in found.items():
        assert np.isfinite(value).all(), output


@pytest.mark.parametrize("name", ONE_IS_QUICK)
def test_no_level_of_its_networks_is_dead(name):
    """A layer that answers 0 to everything cuts off all levels below it, and no loss shows it."""
    architecture, subnetworks = weights.load(SETS[name])
    images = parity.images(architecture.size)
    outputs = assemble(subnetworks)(images)
    seen = {
        "image": images,
        "masked_image": images * outputs["mask"],
        "dichromatic": dichromatic.channels(ops.convert_to_tensor(images), outputs["mask"]),
        "specular_shading": ops.log1p(outputs["specular_shading"]),
        "mirror": ops.log1p(outputs["mirror"]),
    }
    for part, network in subnetworks.items():
        layers = [layer for layer in network.layers if layer.weights]
        given = {tensor.name: seen[tensor.name] for tensor in network.inputs}
        answers = keras.Model(network.inputs, [layer.output for layer in layers])(
            [given[tensor.name] for tensor in network.inputs]
        )
        for layer, answer in zip(layers, answers, strict=True):
            largest = float(ops.max(ops.abs(answer)))
            assert 0 < largest < 65_504, (part, layer.name, largest)


def test_it_finds_a_lit_ball_and_its_colour():
    """On the proof's dull ball, of albedo 0.5, 0.3, 0.2 before stripes: roughly where, and what."""
    image = parity.images(128)[0]
    rows, columns = np.mgrid[:128, :128] / 127 * 2.5 - 1.25
    truth = rows**2 + columns**2 < 1
    material = Estimator().estimate(image)
    found = material.layers["mask"][..., 0] >= 0.5
    assert (found & truth).sum() / (found | truth).sum() > 0.7
    red, green, blue = material.diffuse_albedo
    assert red > green > blue
