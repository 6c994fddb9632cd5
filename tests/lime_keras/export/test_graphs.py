"""The graphs of the subnetworks: written, described, and stored in half the space at no loss."""

import hashlib

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from lime_keras.commands import export as export_cli
from lime_keras.export import graphs, parity
from lime_keras.io import model_folder
from lime_keras.networks import Architecture, build, names, weights
from lime_keras.runtime import graph_folder
from lime_keras.runtime.engine import OnnxEngine


def constants(path):
    """The types of a graph's constants that are large enough to be narrowed, by name."""
    return {
        constant.name: constant.data_type
        for constant in onnx.load(path).graph.initializer
        if numpy_helper.to_array(constant).size >= graphs._LEAST_NARROWED
    }


def written(folder, half):
    """A SegmentationNet stored in float16 or not, and the folder of its graph."""
    architecture = Architecture(size=32, unet_width=8, unet_depth=1, encoder_width=2, dense_width=4)
    subnetworks = {"segmentation": build(architecture, seed=1)["segmentation"]}
    weights.save(folder / "model", architecture, subnetworks, half=half)
    subnetworks = weights.load(folder, whole=False)[1]
    graphs.write(folder / "onnx", architecture, subnetworks, "digest")
    return folder / "onnx", subnetworks["segmentation"]


def test_the_command_writes_a_graph_for_each_subnetwork(tiny, tiny_model, tmp_path, capsys):
    arguments = ["--format", "graphs", "--weights", str(tiny_model)]
    assert export_cli.main([str(tmp_path), *arguments]) == 0
    assert str(tmp_path / "onnx") in capsys.readouterr().out
    found = {path.name for path in (tmp_path / "onnx").iterdir()}
    assert found == {"graphs.json", *(f"{name}.onnx" for name in names(tiny))}
    description = graph_folder.read(tmp_path / "onnx")
    assert description.weights == model_folder.digest(tiny_model)
    assert (description.size, description.system) == (32, "LIME")
    for name, graph in description.graphs.items():
        content = graph_folder.path(tmp_path / "onnx", name).read_bytes()
        assert graph.sha256 == hashlib.sha256(content).hexdigest()
        held = onnx.load_from_string(content).graph
        assert set(graph.inputs) == {tensor.name for tensor in held.input}
        assert set(graph.outputs) == {tensor.name for tensor in held.output}


def test_weights_that_float16_holds_are_stored_in_it_at_no_loss(tmp_path):
    folder, network = written(tmp_path, half=True)
    types = constants(folder / "segmentation.onnx")
    assert types and set(types.values()) == {onnx.TensorProto.FLOAT16}
    images = parity.images(32)
    engine = OnnxEngine(folder, graph_folder.read(folder))
    found = engine.run(["mask"], {"image": images})["mask"]
    raw = network.predict_on_batch(images)
    np.testing.assert_allclose(found, np.clip((raw - 0.5) * 1.5 + 0.5, 0, 1), atol=1e-5)


def test_weights_that_float16_does_not_hold_stay_as_they_are(tmp_path):
    folder, _ = written(tmp_path, half=False)
    types = constants(folder / "segmentation.onnx")
    assert types and set(types.values()) == {onnx.TensorProto.FLOAT}


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e6, 1e-9, 1 + 1e-6])
def test_what_float16_does_not_hold_exactly_is_not_narrowed(value, tmp_path):
    values = np.ones((16, 16), np.float32)
    values[3, 4] = value
    nodes = [onnx.helper.make_node("Add", ["x", "w"], ["y"])]
    tensors = [
        onnx.helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [16, 16]) for name in "xy"
    ]
    held = [numpy_helper.from_array(values, "w")]
    graph = onnx.helper.make_graph(nodes, "sum", tensors[:1], tensors[1:], held)
    path = tmp_path / "sum.onnx"
    onnx.save(onnx.helper.make_model(graph), path)
    graphs._narrow(path)
    # Infinity is a number of float16; NaN is equal to nothing.
    kind = onnx.TensorProto.FLOAT16 if value == np.inf else onnx.TensorProto.FLOAT
    assert set(constants(path).values()) == {kind}


def test_a_part_of_the_outputs_is_refused(tiny_model, tmp_path, capsys):
    arguments = ["--format", "graphs", "--weights", str(tiny_model), "--only", "mask"]
    assert export_cli.main([str(tmp_path / "out"), *arguments]) == 1
    assert "graphs are of a whole model" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
