"""The graphs answer what Keras answers, each opened when it is needed, and damage is told."""

import json
import shutil

import json_files
import numpy as np
import pytest
from whole_engines import Network

from lime_keras.export import parity
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.networks import assemble
from lime_keras.runtime.onnx_graphs import OnnxGraphs
from lime_keras.runtime.sessions import Session


def opened(folder):
    return OnnxGraphs(folder, model_folder.read_description(folder))


@pytest.fixture(scope="module")
def graphs(tiny_model):
    return model_folder.graphs(tiny_model)


@pytest.fixture
def copy(graphs, tmp_path):
    return shutil.copytree(graphs, tmp_path / "onnx")


def test_the_graphs_answer_what_keras_answers(tiny_model, graphs):
    assert opened(graphs).size == 32
    agrees(tiny_model)


def test_an_ablations_graphs_answer_what_keras_answers(ablation_model):
    agrees(ablation_model)


def agrees(model):
    images, engine = parity.images(32), opened(model_folder.graphs(model))
    expected = parity.predictions(Network(assemble(weights.load(model)[1])), images)
    parity.check(expected, parity.predictions(engine, images), "float32")


def test_a_given_mask_replaces_segmentation(tiny_model, graphs):
    images, engine = parity.images(32), opened(graphs)
    mask = np.random.default_rng(0).uniform(size=(8, 32, 32, 1)).astype(np.float32)
    outputs = ["mirror", "diffuse_albedo"]
    expected = assemble(weights.load(tiny_model)[1], outputs, with_mask=True)
    expected = expected.predict_on_batch({"image": images, "mask": mask})
    found = engine.run(outputs, {"image": images, "mask": mask})
    parity.check(expected, found, "float32")
    assert list(engine._sessions) == ["specular", "mirror", "albedo"]


NEEDED = {
    "mask": ("segmentation",),
    "specular_shading": ("segmentation", "specular"),
    "mirror": ("segmentation", "specular", "mirror"),
    "specular_albedo": ("segmentation", "specular", "albedo"),
    "exponent_bin_probabilities": ("segmentation", "specular", "mirror", "exponent"),
}


@pytest.mark.parametrize("output", NEEDED)
def test_only_the_graphs_that_an_output_needs_are_opened(output, graphs):
    engine = opened(graphs)
    assert not engine._sessions
    assert engine.subnetworks([output], ["image"]) == NEEDED[output]
    assert set(engine.run([output], {"image": parity.images(32)[:1]})) == {output}
    assert tuple(engine._sessions) == NEEDED[output]
    assert engine.subnetworks([output], ["image", "mask"]) == NEEDED[output][1:]


def test_all_sizes_of_batch_are_answered(graphs):
    engine, images = opened(graphs), parity.images(32)
    whole = engine.run(["specular_albedo"], {"image": images})["specular_albedo"]
    for count in (1, 3):
        part = engine.run(["specular_albedo"], {"image": images[:count]})["specular_albedo"]
        np.testing.assert_allclose(part, whole[:count], atol=1e-5)


def test_a_damaged_graph_of_a_run_names_the_command(run):
    (run / "onnx" / "specular.onnx").write_bytes(b"not a graph")
    engine, image = opened(run / "onnx"), {"image": parity.images(32)[:1]}
    told = r"specular\.onnx is missing or damaged: run `lime-export .*run --format graphs"
    with pytest.raises(ValueError, match=told):
        engine.run(["specular_shading"], image)


@pytest.mark.parametrize("content", [None, b"", b"not a graph", "cut off"])
def test_a_damaged_graph_is_told_with_the_mend(content, copy):
    path = copy / "specular.onnx"
    if content is None:
        path.unlink()
    else:
        path.write_bytes(path.read_bytes()[:-100] if content == "cut off" else content)
    engine = opened(copy)
    image = {"image": parity.images(32)[:1]}
    assert np.ptp(engine.run(["mask"], image)["mask"]) > 0
    with pytest.raises(ValueError, match=r"specular\.onnx is missing or damaged: take"):
        engine.run(["specular_shading"], image)


@pytest.mark.parametrize(
    "wrong",
    [
        {"inputs": ["compressed_specular_shading"]},
        {"inputs": ["image", "mask", "compressed_mirror"]},
        {"outputs": ["log_exponent"]},
    ],
)
def test_a_graph_that_is_described_otherwise_is_told(wrong, copy):
    with json_files.edited(copy / "graphs.json") as held:
        held["graphs"]["exponent"] |= wrong
    engine, given = opened(copy), {"image": parity.images(32)[:1]}
    outputs = held["graphs"]["exponent"]["outputs"]
    with pytest.raises(ValueError, match=r"graphs\.json describes exponent as it is not .*: take"):
        engine.run(outputs, given)


@pytest.mark.parametrize("told", ["std::bad_alloc", "Failed to allocate memory for buffer of 9"])
def test_want_of_memory_is_no_fault_of_a_graph(told, graphs, monkeypatch):
    class Native:
        def run(self, *_):
            raise RuntimeError(f"Non-zero status code while running Conv: {told}")

    engine = opened(graphs)
    monkeypatch.setattr(Session, "opened", lambda session: Native())
    with pytest.raises(MemoryError, match=told):
        engine.run(["mask"], {"image": parity.images(32)[:1]})


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "{}", '{"layout": 1}', '{"layout": 1, "graphs": []}', "layout"]
)
def test_a_description_that_cannot_be_read_counts_as_none(text, copy):
    path = copy / "graphs.json"
    if text == "layout":
        held = json.loads(path.read_text(encoding="utf-8"))
        text = json.dumps(held | {"layout": model_folder.LAYOUT + 1})
    assert model_folder.read_description(copy) is not None
    path.write_text(text, encoding="utf-8")
    assert model_folder.read_description(copy) is None
    assert model_folder.read_description(copy / "none") is None


MISFITS = {
    "no mask": lambda held: held["graphs"].pop("segmentation"),
    "an input that nothing answers": lambda held: held["graphs"].pop("specular"),
    "an input that is no name": lambda held: held["graphs"]["mirror"].update(inputs=[1]),
    "an output that is no name": lambda held: held["graphs"]["mirror"].update(outputs=[True]),
    "a checksum that is none": lambda held: held["graphs"]["mirror"].update(sha256=5),
    "no size": lambda held: held.update(size=0),
    "a size that is no number": lambda held: held.update(size="64"),
}


@pytest.mark.parametrize("misfit", MISFITS)
def test_a_description_of_graphs_that_do_not_fit_counts_as_none(misfit, copy):
    with json_files.edited(copy / "graphs.json") as held:
        MISFITS[misfit](held)
    assert model_folder.read_description(copy) is None
