"""Graphs that sets have in common lie there once, and every set answers as before."""

import json

import numpy as np

from lime_keras.estimate import engines
from lime_keras.export import parity, sharing
from lime_keras.io import model_folder
from lime_keras.networks import weights
from lime_keras.train import initial_weights


def _answers(name):
    engine = engines.load(model_folder.find(name), "onnx")
    return engine.run(engine.outputs, {"image": parity.images(engine.size)})


def test_sets_share_equal_graphs(sets):
    folder = sets("live", "other", "third")
    changed = folder / "third" / "onnx" / "albedo.onnx"
    before = {name: _answers(name) for name in ("live", "other")}
    held = {name: weights.load(folder / name)[1] for name in ("live", "other")}
    digests = {name: initial_weights.sha256(folder / name) for name in ("live", "other", "third")}
    described = (folder / "third" / "onnx" / model_folder.DESCRIPTION).read_text()
    assert changed.is_file() and "albedo" in described
    told = sharing.share()
    assert len(told) == 10 and "other: albedo of live" in told
    assert len(list((folder / "live" / "onnx").glob("*.onnx"))) == 5
    assert not list((folder / "other" / "onnx").glob("*.onnx"))
    assert sharing.share() == []
    for name, expected in before.items():
        found = _answers(name)
        assert all(np.array_equal(found[output], expected[output]) for output in expected)
        for part, network in weights.load(folder / name)[1].items():
            pairs = zip(network.get_weights(), held[name][part].get_weights(), strict=True)
            assert all(np.array_equal(one, other) for one, other in pairs), part
        assert initial_weights.sha256(folder / name) == digests[name]


def test_graphs_that_differ_stay(sets):
    folder = sets("live", "other")
    description = folder / "other" / "onnx" / model_folder.DESCRIPTION
    text = description.read_text()
    sums = [row["sha256"] for row in json.loads(text)["graphs"].values()]
    description.write_text(text.replace(sums[0], "0" * 64))
    assert len(sharing.share()) == 4
    assert len(list((folder / "other" / "onnx").glob("*.onnx"))) == 1


def test_a_holder_outside_the_package_is_not_followed(sets, tmp_path):
    folder = sets("live", "other")
    sharing.share()
    description = folder / "other" / "onnx" / model_folder.DESCRIPTION
    description.write_text(description.read_text().replace('"live"', '"../../elsewhere"'))
    own = folder / "other" / "onnx" / "albedo.onnx"
    assert model_folder.graph(own.parent, "albedo") == own and not own.exists()
