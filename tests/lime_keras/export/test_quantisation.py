"""Fewer bits: what stays float32, what the files keep, and how their harm is counted."""

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from lime_keras.export import exporter, formats, parity, quantisation
from lime_keras.networks import build


def test_harm_by_hand():
    expected = {"mask": np.array([1.0, -3.0]), "mirror": np.zeros(2)}
    answer = {"mask": np.array([1.5, -2.5]), "mirror": np.zeros(2)}
    assert quantisation.harm(expected, answer) == {"mask": 0.25, "mirror": 0.0}


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
def prepared(tiny_export, tmp_path_factory):
    path = tmp_path_factory.mktemp("quantised") / "prepared.onnx"
    quantisation.prepare(exporter.target(tiny_export("onnx")[0], "onnx"), path)
    return path


def write(precision, prepared, path):
    if precision == "float16":
        quantisation.write_float16(prepared, path)
    else:
        quantisation.write_int8(prepared, path, parity.images(32)[:4])


BITS = {"float16": 16, "int8": 8}


@pytest.mark.parametrize("precision", ["int8", pytest.param("float16", marks=pytest.mark.slow)])
def test_a_narrow_file_takes_any_batch_of_float32_and_has_fewer_bits(precision, prepared, tmp_path):
    path = tmp_path / "narrow.onnx"
    write(precision, prepared, path)
    images = parity.images(32)
    expected = parity.answers(formats.open_onnx(prepared), images)
    found = parity.answers(formats.open_onnx(path), images)
    assert all(value.dtype == np.float32 for value in found.values())
    assert 0 < max(quantisation.harm(expected, found).values()) < parity.GROSS[precision]
    arrays = [numpy_helper.to_array(tensor) for tensor in onnx.load(path).graph.initializer]
    kernels = [array for array in arrays if array.ndim >= 2]
    narrow = sum(array.size for array in kernels if array.itemsize * 8 == BITS[precision])
    # A few constants stay as they are, and int8's heads.
    assert narrow > 0.9 * sum(array.size for array in kernels)
