"""Keras reads out of the graphs exactly what went into them."""

import shutil

import json_files
import numpy as np
import onnx
import onnx_files
import pytest

from lime_keras.model import folder as model_folder
from lime_keras.model import weights, weights_in_graphs
from lime_keras.model.weights_in_graphs import describe


def held(**constants):
    """A graph of these constants that computes nothing."""
    return onnx_files.made([], {}, {}, constants)


def read(path):
    return weights_in_graphs.read(path.read_bytes(), path)


def written(graph, path):
    onnx.save(graph, path)
    return read(path)


def random(*shape):
    return np.random.default_rng(len(shape)).normal(size=shape).astype(np.float32)


def test_the_graphs_of_a_model_hold_its_weights(tiny_model):
    for name, network in weights.load(tiny_model)[1].items():
        found = read(model_folder.graphs(tiny_model) / f"{name}.onnx")
        assert set(found) == {weight.path for weight in network.weights}
        for weight in network.weights:
            assert np.array_equal(found[weight.path], weight.numpy()), (name, weight.path)


def test_those_of_an_ablation_hold_them_too(ablation_model):
    for name, network in weights.load(ablation_model)[1].items():
        found = read(model_folder.graphs(ablation_model) / f"{name}.onnx")
        for weight in network.weights:
            assert np.array_equal(found[weight.path], weight.numpy()), (name, weight.path)


def test_axes_are_moved_back(tmp_path):
    kernel, dense = random(3, 3, 4, 4), random(16, 16)
    graph = held(k=kernel.transpose(3, 2, 0, 1).copy(), d=dense.T.copy())
    expected = {"conv/kernel": kernel, "dense/kernel": dense}
    describe(graph, expected)
    found = written(graph, tmp_path / "graph.onnx")
    assert all(np.array_equal(found[name], values) for name, values in expected.items())


@pytest.mark.parametrize("value", [0.0, -0.0, 1e-45, 3.4e38, np.inf, np.nan, 1 / 3])
def test_a_weight_that_no_constant_holds_is_told_bit_by_bit(value, tmp_path):
    graph, bias = held(other=random(4)), np.full(3, value, np.float32)
    describe(graph, {"bias": bias})
    found = written(graph, tmp_path / "graph.onnx")["bias"]
    assert found.dtype == np.float32 and found.tobytes() == bias.tobytes()


def test_half_precision_and_equal_constants_are_read(tmp_path):
    values = random(32, 32).astype(np.float16)
    graph = held(one=values, zero=np.zeros(4, np.float32))
    zeros = np.zeros(4, np.float32)
    describe(graph, {"kernel": np.float32(values), "a/bias": zeros, "b/bias": zeros})
    found = written(graph, tmp_path / "graph.onnx")
    assert np.array_equal(found["kernel"], np.float32(values))
    assert found["kernel"].dtype == np.float32
    assert np.array_equal(found["a/bias"], zeros) and np.array_equal(found["b/bias"], zeros)


def test_a_graph_that_lacks_a_large_weight_holds_none(tmp_path):
    graph, small = held(one=random(4)), weights_in_graphs._MOST_REPEATED
    describe(graph, {"bias": random(4), "kernel": random(small + 1)})
    with pytest.raises(ValueError, match=r"graph\.onnx holds no weights.*the run"):
        written(graph, tmp_path / "graph.onnx")


@pytest.mark.parametrize("content", [b"", b"no graph"])
def test_what_is_no_graph_is_told(content, tmp_path):
    path = tmp_path / "graph.onnx"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"graph\.onnx holds no weights"):
        read(path)


def test_constants_in_another_file_are_refused(tmp_path):
    graph, values = held(kernel=random(3, 2)), random(3, 2)
    describe(graph, {"kernel": values})
    onnx.save(graph, tmp_path / "graph.onnx", save_as_external_data=True, size_threshold=0)
    with pytest.raises(ValueError, match=r"graph\.onnx holds no weights"):
        read(tmp_path / "graph.onnx")


@pytest.fixture
def bare(tiny_model, tmp_path):
    """A model whose weights lie in its graphs alone."""
    run = shutil.copytree(tiny_model.parent, tmp_path / "bare")
    for path in (run / "model").glob("*.h5"):
        path.unlink()
    return run


def test_a_model_is_loaded_from_its_graphs(bare, tiny_model):
    expected = weights.load(tiny_model)
    for folder in (bare, bare / "model"):
        architecture, found = weights.load(folder)
        assert architecture == expected[0] and list(found) == list(expected[1])
        for name, network in expected[1].items():
            pairs = zip(found[name].get_weights(), network.get_weights(), strict=True)
            assert all(np.array_equal(one, other) for one, other in pairs), name


def test_it_is_the_same_model(bare, tiny_model):
    assert model_folder.digest(bare) == model_folder.digest(tiny_model)
    assert [path.suffix for path in model_folder.files(bare)] == [".json"] + [".onnx"] * 5


def test_a_part_of_it_is_loaded_or_told(bare):
    (bare / "onnx" / "mirror.onnx").unlink()
    assert list(weights.load(bare, whole=False)[1]) == [
        "segmentation",
        "specular",
        "exponent",
        "albedo",
    ]
    with pytest.raises(FileNotFoundError, match=r"mirror\.onnx is missing.*lime-train"):
        weights.load(bare)


def test_a_graph_of_other_layers_is_told(bare):
    shutil.copyfile(bare / "onnx" / "albedo.onnx", bare / "onnx" / "mirror.onnx")
    with json_files.edited(bare / "onnx" / "graphs.json") as description:
        description["graphs"]["mirror"]["sha256"] = description["graphs"]["albedo"]["sha256"]
    with pytest.raises(ValueError, match=r"mirror\.onnx has other layers than mirror_net"):
        weights.load(bare)


def test_a_graph_of_other_weights_is_told(bare):
    path = bare / "onnx" / "mirror.onnx"
    path.write_bytes(path.read_bytes() + b" ")
    with pytest.raises(ValueError, match=r"mirror\.onnx is missing or damaged: take"):
        weights.load(bare)


def test_damage_in_a_set_that_comes_with_the_package_is_mended_by_installing(bare, monkeypatch):
    monkeypatch.setattr(model_folder, "PRETRAINED", bare.parent)
    (bare / "onnx" / "segmentation.onnx").write_bytes(b"no graph")
    with pytest.raises(ValueError, match=r"segmentation\.onnx is missing or damaged: install the"):
        weights.load(bare)


@pytest.mark.parametrize("damage", ["no JSON", "no mirror"])
def test_weights_without_a_description_are_told(bare, damage):
    with json_files.edited(bare / "onnx" / "graphs.json") as description:
        del description["graphs"]["mirror"]
    if damage == "no JSON":
        (bare / "onnx" / "graphs.json").write_text("{")
    with pytest.raises(ValueError, match=r"graphs\.json does not describe .*: take .*weights"):
        weights.load(bare)
