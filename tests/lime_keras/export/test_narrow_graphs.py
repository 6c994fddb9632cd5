"""Graphs in fewer bits: valid, near those in float32, refused where a second runtime differs."""

import numpy as np
import onnx
import onnx_files
import pytest

from lime_keras import Estimator
from lime_keras.export import exporter, formats, parity, quantisation, reference
from lime_keras.runtime import onnx_graphs


@pytest.mark.slow
def test_graphs_in_eight_bits_lie_beside_a_copy_of_the_model(tiny_model, corpus, tmp_path):
    differences = exporter.export(
        tmp_path, exporter.GRAPHS, tiny_model, precision="int8", corpus=corpus
    )
    assert 0 < max(differences["pictures"].values()) < parity.GROSS["int8"]
    assert {path.name for path in tmp_path.iterdir()} == {"model", "onnx", "onnx-int8"}
    for path in (tmp_path / "onnx-int8").glob("*.onnx"):
        onnx.checker.check_model(str(path), full_check=True)
        kinds = {node.op_type for node in onnx.load(path).graph.node}
        assert "QuantizeLinear" in kinds
    photo = parity.images(32)[0]
    plain = Estimator(tmp_path).estimate(photo)
    narrow = Estimator(tmp_path, precision="int8").estimate(photo)
    assert narrow.to_json() != plain.to_json()
    assert narrow.diffuse_albedo == pytest.approx(plain.diffuse_albedo, abs=0.1)


def overflowing(path, *, scale):
    """Write a file that multiplies and divides by a number in float16, where 65,504 is the most."""
    nodes = [
        onnx.helper.make_node("Cast", ["image"], ["narrow"], to=onnx.TensorProto.FLOAT16),
        onnx.helper.make_node("Mul", ["narrow", "scale"], ["large"]),
        onnx.helper.make_node("Div", ["large", "scale"], ["back"]),
        onnx.helper.make_node("Cast", ["back"], ["mask"], to=onnx.TensorProto.FLOAT),
    ]
    image, mask = ({name: ["batch", 8, 8, 3]} for name in ("image", "mask"))
    number = {"scale": np.array(scale, np.float16)}
    onnx.save(onnx_files.made(nodes[::-1], image, mask, number), path)


def test_a_file_is_sorted_and_the_second_runtime_sees_an_overflow(tmp_path):
    images = np.full((1, 8, 8, 3), 4.0, np.float32)
    for scale, fits in ((100.0, True), (60000.0, False)):
        path = tmp_path / f"{scale}.onnx"
        overflowing(path, scale=scale)
        card = {"description": "LIME", "input_shape": ["batch", 8, 8, 3], "outputs": {"mask": {}}}
        formats.finish_onnx(path, card)
        engine = onnx_graphs.open_file(path)
        assert parity.predictions(engine, images)["mask"] == pytest.approx(images)
        found = parity.predictions(reference.ReferenceGraphs(engine), images)["mask"]
        assert np.isfinite(found).all() == fits


def test_sums_over_pixels_keep_their_bits_in_float16(tmp_path):
    """Their terms reach float16's largest number together."""
    node = onnx.helper.make_node("ReduceMean", ["image"], ["mask"], axes=[1, 2], name="mean")
    shapes = {"image": ["batch", 64, 64, 3]}, {"mask": ["batch", 1, 1, 3]}
    onnx.save(onnx_files.made([node], *shapes), tmp_path / "half.onnx")
    quantisation.narrow(tmp_path / "half.onnx", "float16", [])
    half = onnx.load(tmp_path / "half.onnx")
    formats.settle(half)
    [mean] = onnx.reference.ReferenceEvaluator(half).run(
        None, {"image": np.full((1, 64, 64, 3), 99.0, np.float32)}
    )
    assert mean == pytest.approx(99.0, rel=1e-3)


def test_a_sum_beyond_float16_is_read_in_float32(tmp_path):
    """Of 320 × 320 pixels as many as lie inside a mask: here all."""
    nodes = [
        onnx.helper.make_node("ReduceSum", ["image", "axes"], ["sum"], name="sum"),
        onnx.helper.make_node("Div", ["sum", "count"], ["mask"], name="mean"),
    ]
    shapes = {"image": ["batch", 320, 320, 3]}, {"mask": ["batch", 1, 1, 3]}
    numbers = {"axes": np.array([1, 2]), "count": np.array(320.0**2, np.float32)}
    onnx.save(onnx_files.made(nodes, *shapes, numbers), tmp_path / "half.onnx")
    quantisation.narrow(tmp_path / "half.onnx", "float16", [])
    half = onnx.load(tmp_path / "half.onnx")
    formats.settle(half)
    [mean] = onnx.reference.ReferenceEvaluator(half).run(
        None, {"image": np.ones((1, 320, 320, 3), np.float32)}
    )
    assert mean == pytest.approx(1.0, rel=1e-3)


def test_the_reference_runs_folders_of_graphs(tiny_model):
    engine = onnx_graphs.open_folder(tiny_model.parent / "onnx")
    images = parity.images(32)[:1]
    expected = parity.predictions(engine, images)
    found = parity.predictions(reference.ReferenceGraphs(engine), images)
    parity.check(expected, found, "float32")
