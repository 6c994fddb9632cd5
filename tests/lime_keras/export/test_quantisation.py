"""Fewer bits: what stays float32, what the files keep, and how their harm is counted."""

import dataclasses
import shutil

import keras
import numpy as np
import onnx
import pytest
from keras import layers
from onnx import numpy_helper
from whole_engines import File

from lime_keras.export import formats, parity, quantisation
from lime_keras.export.standalone import parts
from lime_keras.model import weights
from lime_keras.networks import assemble, build
from lime_keras.networks.guided_filter import GuidedFilter


def test_what_the_split_of_colours_is_computed_from_keeps_its_bits(tiny, tmp_path):
    subnetworks = build(dataclasses.replace(tiny, dichromatic=True))
    formats.write_onnx(parts(subnetworks)["dichromatic"], tmp_path / "split.onnx")
    model = onnx.load(tmp_path / "split.onnx")
    repeated = {one.name for one in model.graph.node if one.name.endswith(formats.REPEATED)}
    assert repeated and repeated <= set(quantisation.in_float32(model))


def test_harm_by_hand():
    expected = {"mask": np.array([1.0, -3.0]), "mirror": np.zeros(2)}
    answer = {"mask": np.array([1.5, -2.5]), "mirror": np.zeros(2)}
    assert quantisation.relative_error(expected, answer) == {"mask": 0.25, "mirror": 0.0}


def test_the_heads_are_every_subnetworks_last_layers(ablation, tiny):
    """Those with weights behind which no other layer has any."""
    for architecture in (tiny, ablation):
        for network in build(architecture).values():
            weighted = [layer for layer in network.layers if layer.weights]
            last = [
                layer.name
                for layer in weighted
                if not any(
                    after.weights
                    for node in layer._outbound_nodes
                    if (after := node.operation) in network.layers
                )
                and layer.dtype_policy.name == "float32"
                and layer.get_config()["activation"] == "linear"
            ]
            assert last and set(last) <= set(quantisation.HEADS)


@pytest.fixture(scope="module")
def prepared(tiny_model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("quantised")
    formats.write_onnx(assemble(weights.load(tiny_model)[1]), folder / "prepared.onnx")
    quantisation.narrow(folder / "prepared.onnx", "float32", [])
    return folder / "prepared.onnx"


def write(precision, prepared, path):
    shutil.copy(prepared, path)
    inputs = [{"image": image[None]} for image in parity.images(32)[:4]]
    quantisation.narrow(path, precision, inputs)


BITS = {"float16": 16, "int8": 8}


@pytest.mark.parametrize("precision", ["int8", pytest.param("float16", marks=pytest.mark.slow)])
def test_a_narrow_file_takes_any_batch_of_float32_and_has_fewer_bits(precision, prepared, tmp_path):
    path = tmp_path / "narrow.onnx"
    write(precision, prepared, path)
    images = parity.images(32)
    expected = parity.predictions(File(prepared), images)
    found = parity.predictions(File(path), images)
    assert all(value.dtype == np.float32 for value in found.values())
    assert 0 < max(quantisation.relative_error(expected, found).values()) < parity.GROSS[precision]
    kernels = kernels_of(path)
    if precision == "int8":
        # The rest of what stays float32 has a test of its own.
        kernels = {name: x for name, x in kernels.items() if "/specular_net" not in name}
    narrow = sum(x.size for x in kernels.values() if x.itemsize * 8 == BITS[precision])
    # A few constants stay as they are, and int8's heads.
    assert narrow > 0.9 * sum(x.size for x in kernels.values())


def kernels_of(path):
    tensors = {one.name: numpy_helper.to_array(one) for one in onnx.load(path).graph.initializer}
    return {name: tensor for name, tensor in tensors.items() if tensor.ndim >= 2}


def test_heads_and_the_way_up_to_s_alone_stay_float32(prepared, tmp_path):
    path = tmp_path / "narrow.onnx"
    write("int8", prepared, path)
    stay = {
        "/".join(part.rstrip("_0123456789") for part in name.split("/")[1:3])
        for name, kernel in kernels_of(path).items()
        if name.count("/") > 2 and kernel.dtype == np.float32
    }
    heads = {f"{name}_net/head" for name in ("segmentation", "specular", "mirror")}
    assert stay == {*heads, "exponent_net/logits", "albedo_net/albedos", "specular_net/up0_conv"}


@pytest.fixture(scope="module")
def saturated(tmp_path_factory):
    """A prepared encoder whose ReLU6s cut most of what its convolutions make, and its kernels."""
    image = keras.Input((32, 32, 3), name="image")
    x = layers.Conv2D(8, 1, activation="relu6")(image)
    x = layers.DepthwiseConv2D(3, padding="same", activation="relu6")(x)
    network = keras.Model(image, {"mask": layers.Conv2D(1, 1, name="head")(x)}, name="lime")
    rng = np.random.default_rng(0)
    # Channels of a depthwise layer differ much in size, as trained ones do.
    sizes = [60.0, np.geomspace(0.1, 10, 8).reshape(1, 1, 8, 1), 1.0]
    for layer, size in zip(network.layers[1:], sizes, strict=True):
        kernel, bias = layer.get_weights()
        layer.set_weights([size * rng.normal(size=kernel.shape), bias])
    folder = tmp_path_factory.mktemp("saturated")
    formats.write_onnx(network, folder / "prepared.onnx")
    quantisation.narrow(folder / "prepared.onnx", "float32", [])
    return folder / "prepared.onnx"


def test_relu6_and_depthwise_layers_cost_little_in_eight_bits(saturated, tmp_path):
    path, images = tmp_path / "narrow.onnx", parity.images(32)
    shutil.copy(saturated, path)
    quantisation.narrow(path, "int8", [{"image": one[None]} for one in images])
    expected = parity.predictions(File(saturated), images)
    found = parity.predictions(File(path), images)
    assert 0 < quantisation.relative_error(expected, found)["mask"] < 0.01
    graph = onnx.load(path).graph
    # What cuts is in the scales.
    assert not [node for node in graph.node if node.op_type == "Clip"]
    [depthwise] = [x for x in kernels_of(path).values() if x.shape == (8, 1, 3, 3)]
    assert depthwise.dtype == np.uint8
    assert all(one.min() == 0 or one.max() == 255 for one in depthwise)  # each by its own scale


def test_what_clips_no_convolution_stays_float32(saturated):
    """Nor what clips a last layer, as the mask's contrast may."""
    model = onnx.load(saturated)
    [head] = quantisation.heads(model)
    [answer] = next(node.output for node in model.graph.node if node.name == head)
    before = set(quantisation.in_float32(model))
    for source in ("image", answer):
        model.graph.node.append(
            onnx.helper.make_node("Clip", [source], [f"{source}-cut"], name=f"cut-{source}")
        )
    assert set(quantisation.in_float32(model)) == before | {"cut-image", f"cut-{answer}"}


@pytest.fixture(scope="module")
def filtered(tmp_path_factory):
    """A prepared model whose mask is the brightness of the picture, filtered."""
    image = keras.Input((32, 32, 3), name="image")
    mask = layers.Conv2D(1, 1, kernel_initializer=keras.initializers.Constant(1 / 3))(image)
    mask = GuidedFilter(name="guided")([mask, image])
    network = keras.Model({"image": image}, {"mask": mask}, name="segmentation_net")
    whole = keras.Input((32, 32, 3), name="image")
    folder = tmp_path_factory.mktemp("filtered")
    path = folder / "prepared.onnx"
    formats.write_onnx(keras.Model(whole, network({"image": whole}), name="lime"), path)
    quantisation.narrow(path, "float32", [])
    return path


@pytest.mark.parametrize("precision, bound", [("float16", 3e-3), ("int8", 0.05)])
def test_the_guided_filter_computes_in_float32(precision, bound, filtered, tmp_path):
    """Its variances of faint pictures are below the last bit of half precision."""
    path = tmp_path / "narrow.onnx"
    write(precision, filtered, path)
    images = 0.7 + 0.02 * parity.images(32)
    expected = parity.predictions(File(filtered), images)
    found = parity.predictions(File(path), images)
    assert quantisation.relative_error(expected, found)["mask"] < bound
    model = onnx.load(path)
    produced = {output: node for node in model.graph.node for output in node.output}
    assert any(quantisation._GUIDED.search(node.name) for node in model.graph.node)
    for node in model.graph.node:
        inner = [produced[name] for name in node.input if name in produced]
        if quantisation._GUIDED.search(node.name):
            # Nothing narrows a value on its way from one node of the filter to the next.
            assert not [
                one
                for one in inner
                if one.op_type == "Cast"
                and one.input[0] in produced
                and produced[one.input[0]].op_type == "Cast"
            ]
