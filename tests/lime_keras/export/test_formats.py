"""What is in the written files: signatures, their sub-graphs, names, dimensions, descriptions."""

import json
import shutil

import numpy as np
import onnx
import onnx_files
import onnxruntime
import pytest
import tensorflow as tf

from lime_keras.export import exporter, formats, parity
from lime_keras.model import weights
from lime_keras.networks import assemble
from lime_keras.runtime.saved_model import CARD as CARD_PATH
from lime_keras.runtime.saved_model import SERVED

CARD = {"version": "1.2", "preset": None, "bins": [1.0, 2.5], "outputs": {"mask": "share"}}
NEEDED = {
    "mask": ["segmentation"],
    "specular_shading": ["segmentation", "specular"],
    "mirror": ["segmentation", "specular", "mirror"],
    "diffuse_albedo": ["segmentation", "specular", "albedo"],
    "specular_albedo": ["segmentation", "specular", "albedo"],
    "exponent_bin_probabilities": ["segmentation", "specular", "mirror", "exponent"],
    "serving_default": ["segmentation", "specular", "mirror", "albedo", "exponent"],
}
OUTPUTS = set(NEEDED) - {SERVED}


@pytest.fixture(scope="module")
def subnetworks(tiny_model):
    return weights.load(tiny_model)[1]


@pytest.fixture(scope="module")
def saved_model(tiny_export, tmp_path_factory):
    path = tmp_path_factory.mktemp("formats") / "saved_model"
    shutil.copytree(exporter.target(tiny_export("savedmodel")[0], "savedmodel"), path)
    shutil.rmtree(path / "assets.extra")
    formats.write_card(path / CARD_PATH, CARD)
    return path


@pytest.fixture(scope="module")
def onnx_file(tiny_export, tmp_path_factory):
    path = tmp_path_factory.mktemp("formats") / "lime.onnx"
    shutil.copyfile(exporter.target(tiny_export("onnx")[0], "onnx"), path)
    formats.finish_onnx(path, CARD)
    return path


@pytest.fixture(scope="module")
def loaded(saved_model):
    return tf.saved_model.load(str(saved_model))


def test_there_is_a_signature_for_everything_and_one_for_each_output(loaded):
    assert set(loaded.signatures) == set(NEEDED) == {SERVED, *OUTPUTS}
    for name, signature in loaded.signatures.items():
        outputs = OUTPUTS if name == SERVED else {name}
        assert set(signature.structured_outputs) == outputs
        [image] = signature.structured_input_signature[1].values()
        assert image == tf.TensorSpec((None, 32, 32, 3), tf.float32, name="image")
        for output in signature.structured_outputs.values():
            assert output.shape[0] is None and None not in output.shape[1:]


@pytest.mark.parametrize("name", NEEDED)
def test_a_signature_holds_the_subnetworks_that_its_output_needs(name, loaded, subnetworks):
    """Its captured variables are theirs, and its convolutions and products as many as theirs."""
    needed = [subnetworks[one] for one in NEEDED[name]]
    signature = loaded.signatures[name]
    assert len(signature.captured_inputs) == sum(len(network.variables) for network in needed)
    kernels = [v for network in needed for v in network.variables if v.name == "kernel"]
    weighted = {"Conv2D", "MatMul", "Conv2DBackpropInput"}
    assert sum(node.op in weighted for node in nodes(signature)) == len(kernels)


def nodes(signature):
    """All that a signature runs, functions that it calls included."""
    definition = signature.graph.as_graph_def()
    return [*definition.node, *(n for f in definition.library.function for n in f.node_def)]


def test_signatures_share_the_variables(loaded, saved_model, subnetworks):
    whole = {id(handle) for handle in loaded.signatures[SERVED].captured_inputs}
    for signature in loaded.signatures.values():
        assert {id(handle) for handle in signature.captured_inputs} <= whole
    stored = tf.train.list_variables(str(saved_model / "variables" / "variables"))
    numbers = sum(np.prod(shape, dtype=int) for name, shape in stored if "shared" in name)
    assert numbers == sum(network.count_params() for network in subnetworks.values())


def test_what_tensorflow_serving_reads_is_there(saved_model, subnetworks):
    """Its loader takes the graph tagged `serve`, and feeds and fetches tensors by their names."""
    images = parity.images(32)[:3]
    expected = assemble(subnetworks)(images)
    with tf.Graph().as_default(), tf.compat.v1.Session() as session:
        loaded = tf.compat.v1.saved_model.load(session, ["serve"], str(saved_model))
        for name in NEEDED:
            definition = loaded.signature_def[name]
            assert definition.method_name == "tensorflow/serving/predict"
            fetched = {key: tensor.name for key, tensor in definition.outputs.items()}
            found = session.run(fetched, {definition.inputs["image"].name: images})
            assert set(found) == (OUTPUTS if name == SERVED else {name})
            for output, value in found.items():
                np.testing.assert_allclose(value, expected[output], rtol=1e-4, atol=1e-5)


def test_the_description_lies_in_a_saved_models_extra_assets(saved_model):
    text = (saved_model / "assets.extra" / "lime.json").read_text(encoding="utf-8")
    assert json.loads(text) == CARD


def test_an_onnx_file_names_its_tensors_and_the_batch(onnx_file):
    onnx.checker.check_model(str(onnx_file), full_check=True)
    session = onnxruntime.InferenceSession(str(onnx_file), providers=["CPUExecutionProvider"])
    [image] = session.get_inputs()
    assert (image.name, image.type) == ("image", "tensor(float)")
    assert image.shape == ["batch", 32, 32, 3]
    shapes = {output.name: output.shape for output in session.get_outputs()}
    layers = {key: ["batch", 32, 32, 1] for key in ("mask", "specular_shading", "mirror")}
    assert shapes == layers | {
        "diffuse_albedo": ["batch", 3],
        "specular_albedo": ["batch", 1],
        "exponent_bin_probabilities": ["batch", 8],
    }


def test_the_description_is_an_onnx_files_properties(onnx_file):
    session = onnxruntime.InferenceSession(str(onnx_file), providers=["CPUExecutionProvider"])
    found = session.get_modelmeta().custom_metadata_map
    assert found.pop("version") == CARD["version"]
    assert {name: json.loads(text) for name, text in found.items()} == {
        name: value for name, value in CARD.items() if name != "version"
    }


def test_operands_get_shapes_that_are_fast_and_no_value_changes():
    """A number beside one channel, one channel beside three, and what is fast already."""
    shapes = {"rgb": ["batch", 8, 8, 3], "grey": ["batch", 8, 8, 1], "row": ["batch", 1]}
    nodes = [
        onnx.helper.make_node("Mul", ["rgb", "grey"], ["masked"], "first"),
        onnx.helper.make_node("Sub", ["grey", "masked"], ["difference"], "second"),
        onnx.helper.make_node("Max", ["grey", "half"], ["floored"], "third"),
        onnx.helper.make_node("Add", ["half", "row"], ["raised"], "fourth"),
        onnx.helper.make_node("Add", ["floored", "floored"], ["doubled"], "fifth"),
        onnx.helper.make_node("Mul", ["difference", "half"], ["halved"], "sixth"),
    ]
    outputs = {"halved": shapes["rgb"], "doubled": shapes["grey"], "raised": shapes["row"]}
    model = onnx_files.made(nodes, shapes, outputs, {"half": np.array(0.5, np.float32)})
    rng = np.random.default_rng(0)
    given = {
        name: rng.uniform(size=(2, *shape[1:])).astype(np.float32) for name, shape in shapes.items()
    }

    def answers():
        onnx.checker.check_model(model)
        session = onnxruntime.InferenceSession(model.SerializeToString())
        return session.run(list(outputs), given)

    expected = answers()
    formats._ease_broadcasts(model)
    for found, value in zip(answers(), expected, strict=True):
        np.testing.assert_array_equal(found, value)
    read = {one.name: list(one.input) for one in model.graph.node}
    assert read["first/repeated"] == ["grey"] * 3
    # One copy of the channel for both that read it, and each number as its operand asks.
    assert read["first"] == ["rgb", "grey/3_channels"] and read["second"] == [
        "grey/3_channels",
        "masked",
    ]
    assert read["third"] == ["grey", "half/1_channels"] and read["fourth"] == ["half", "row"]
    assert read["sixth"] == ["difference", "half"] and len(read) == len(nodes) + 1


def test_upsampling_is_one_operator_whose_coordinates_onnx_knows(onnx_file):
    nodes = onnx.load(onnx_file).graph.node
    resizing = [node for node in nodes if node.op_type == "Resize"]
    names = {attribute.s for node in resizing for attribute in node.attribute}
    assert resizing and b"asymmetric" in names and b"tf_half_pixel_for_nn" not in names
    assert not any(node.op_type == "Tile" for node in nodes)


def test_an_onnx_file_holds_no_constant_that_nothing_reads(onnx_file):
    graph = onnx.load(onnx_file).graph
    read = {name for node in graph.node for name in node.input}
    assert {constant.name for constant in graph.initializer} <= read
