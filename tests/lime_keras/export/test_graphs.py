"""The graphs of the subnetworks: written, described, and stored in half the space at no loss."""

import hashlib
import os
import shutil
import subprocess
import sys

import numpy as np
import onnx
import onnx_files
import pytest
from onnx import numpy_helper
from whole_engines import Network

from lime_keras.commands import export as export_cli
from lime_keras.export import formats, graphs, parity
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.networks import Architecture, assemble, build, subnetwork_names
from lime_keras.runtime.onnx_graphs import OnnxGraphs


def constants(path):
    """The types of a graph's constants that are large enough to be narrowed, by name."""
    return {
        constant.name: constant.data_type
        for constant in onnx.load(path).graph.initializer
        if numpy_helper.to_array(constant).size >= graphs._LEAST_NARROWED
    }


def written(folder, half, **options):
    """A SegmentationNet stored in float16 or not, and the folder of its graph."""
    architecture = Architecture(32, 8, 1, 2, 4, **options)
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
    assert found == {"graphs.json", *(f"{name}.onnx" for name in subnetwork_names(tiny))}
    description = model_folder.read_description(tmp_path / "onnx")
    assert description.weights == model_folder.digest(tiny_model)
    assert (description.size, description.system) == (32, "LIME")
    for name, graph in description.graphs.items():
        content = (tmp_path / "onnx" / f"{name}.onnx").read_bytes()
        assert graph.sha256 == hashlib.sha256(content).hexdigest()
        held = onnx.load_from_string(content).graph
        assert set(graph.inputs) == {tensor.name for tensor in held.input}
        assert set(graph.outputs) == {tensor.name for tensor in held.output}


def test_a_model_with_the_split_has_one_graph_for_it_that_keras_needs_not(split_model, tmp_path):
    run = shutil.copytree(split_model.parent, tmp_path / "run")
    for path in (run / "model").glob("*.weights.h5"):
        path.unlink()
    engine = OnnxGraphs(run / "onnx", model_folder.read_description(run / "onnx"))
    images = parity.images(32)
    found = parity.predictions(engine, images)
    joined = assemble(weights.load(run)[1])  # from the graphs, which alone hold weights now
    parity.check(parity.predictions(Network(joined), images), found, "float32")
    assert all(np.ptp(values) > 1e-3 for values in found.values())
    assert (run / "onnx" / "dichromatic.onnx") in model_folder.files(run)
    assert "dichromatic" in engine._sessions and "dichromatic" not in engine.outputs
    assert engine.subnetworks(["diffuse_albedo"], ["image", "mask"]) == ("specular", "albedo")


def test_weights_that_float16_holds_are_stored_in_it_at_no_loss(tmp_path):
    folder, network = written(tmp_path, half=True)
    types = constants(folder / "segmentation.onnx")
    assert types and set(types.values()) == {onnx.TensorProto.FLOAT16}
    images = parity.images(32)
    engine = OnnxGraphs(folder, model_folder.read_description(folder))
    found = engine.run(["mask"], {"image": images})["mask"]
    raw = network.predict_on_batch(images)
    np.testing.assert_allclose(found, np.clip((raw - 0.5) * 1.5 + 0.5, 0, 1), atol=1e-5)


def test_weights_that_float16_does_not_hold_stay_as_they_are(tmp_path):
    folder, _ = written(tmp_path, half=False)
    types = constants(folder / "segmentation.onnx")
    assert types and set(types.values()) == {onnx.TensorProto.FLOAT}


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e6, 1e-9, 1 + 1e-6])
def test_what_float16_does_not_hold_exactly_is_not_narrowed(value):
    values = np.ones((16, 16), np.float32)
    values[3, 4] = value
    nodes = [onnx.helper.make_node("Add", ["x", "w"], ["y"])]
    model = onnx_files.made(nodes, {"x": [16, 16]}, {"y": [16, 16]}, {"w": values})
    graphs._narrow(model)
    # Infinity is a number of float16; NaN is equal to nothing.
    kind = onnx.TensorProto.FLOAT16 if value == np.inf else onnx.TensorProto.FLOAT
    assert [constant.data_type for constant in model.graph.initializer] == [kind]


EXPORT = """
import sys
from pathlib import Path
from lime_keras.export import formats, graphs
from lime_keras.model import weights
from lime_keras.export.standalone import standalone

architecture, subnetworks = weights.load(Path(sys.argv[1]))
chosen = {name: subnetworks[name] for name in ("segmentation", "albedo")}
if sys.argv[3] == "later":
    # What was converted before in the process moves on the converter's numbers.
    formats.write_onnx(standalone("exponent", subnetworks["exponent"]), Path(sys.argv[2] + ".onnx"))
graphs.write(Path(sys.argv[2]), architecture, chosen, "digest")
"""


@pytest.mark.slow
def test_the_same_weights_give_the_same_bytes_in_every_process(tiny_model, tmp_path):
    for seed, when in (("1", "first"), ("2", "later")):
        command = [sys.executable, "-c", EXPORT, tiny_model, tmp_path / seed, when]
        subprocess.run(command, check=True, env=os.environ | {"PYTHONHASHSEED": seed})
    files = sorted(path.name for path in (tmp_path / "1").iterdir())
    assert files == ["albedo.onnx", "graphs.json", "segmentation.onnx"]
    for name in files:
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes(), name


def renamed(model, order):
    """The same graph with other names, its nodes and constants in another order."""
    out = onnx.ModelProto()
    out.CopyFrom(model)
    kept = {"", *(tensor.name for tensor in (*out.graph.input, *out.graph.output))}
    nodes, held = list(out.graph.node), list(out.graph.initializer)
    for node in nodes:
        node.name = f"node {order}"
        for held_names in (node.input, node.output):
            held_names[:] = [name if name in kept else f"{name} {order}" for name in held_names]
    for constant in held:
        constant.name = f"{constant.name} {order}"
    for field, items in (("node", nodes), ("initializer", held)):
        out.graph.ClearField(field)
        getattr(out.graph, field).extend(items[::order])
    return out


def test_a_graph_is_settled_by_what_it_computes_alone():
    """Equal constants are kept once, those that nothing reads are not."""
    ones, twos = np.ones((2, 2), np.float32), np.full((2, 2), 2, np.float32)
    held = {"a": ones, "b": ones, "c": twos, "unread": twos + 1, "limit": np.float32(0.5)}
    nodes = [
        onnx.helper.make_node("Mul", ["x", "a"], ["u"]),
        onnx.helper.make_node("Split", ["u"], ["v", "w"], axis=0),
        onnx.helper.make_node("Clip", ["v", "", "limit"], ["clipped"]),
        onnx.helper.make_node("Add", ["clipped", "b"], ["y"]),
        onnx.helper.make_node("Add", ["y", "c"], ["z"]),
        onnx.helper.make_node("Neg", ["w"], ["unread too"]),
    ]
    model = onnx_files.made(nodes, {"x": [2, 2]}, {"y": [2, 2], "z": [2, 2]}, held)
    settled = []
    for order in (1, -1):
        changed = renamed(model, order)
        formats.settle(changed)
        settled.append(changed.SerializeToString(deterministic=True))
    assert settled[0] == settled[1]
    graph = onnx.load_from_string(settled[0]).graph
    assert len(graph.initializer) == 3 and len(graph.node) == 5
    assert [node.op_type for node in graph.node] == ["Mul", "Split", "Clip", "Add", "Add"]
    onnx.checker.check_model(onnx.load_from_string(settled[0]))
    assert [tensor.name for tensor in graph.output] == ["y", "z"] and graph.input[0].name == "x"


def test_a_part_of_the_outputs_is_refused(tiny_model, tmp_path, capsys):
    arguments = ["--format", "graphs", "--weights", str(tiny_model), "--only", "mask"]
    assert export_cli.main([str(tmp_path / "out"), *arguments]) == 1
    assert "graphs are of a whole model" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
