"""The engines: when a run is exported, and what is told if it cannot be."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

from lime_keras import Estimator, console
from lime_keras.estimate import engines
from lime_keras.export import exporter
from lime_keras.model import folder as model_folder
from lime_keras.model import weights

PHOTO = np.random.default_rng(0).uniform(size=(40, 90, 3)).astype(np.float32)


@pytest.fixture
def run(tiny_model, tmp_path):
    """A run of its own, which was exported."""
    return shutil.copytree(tiny_model.parent, tmp_path / "run")


@pytest.fixture
def exports(monkeypatch):
    """The runs that were exported."""
    asked, export = [], exporter.export
    monkeypatch.setattr(exporter, "export", lambda *a: (asked.append(a[2]), export(*a)))
    return asked


def test_an_exported_run_is_not_exported_again(run, exports, capsys):
    Estimator(run)
    Estimator(run / "model")
    assert not exports and capsys.readouterr() == ("", "")


def test_a_run_is_exported_again_when_its_weights_change(run, exports, capsys):
    first = Estimator(run, ["albedo"]).estimate(PHOTO)
    architecture, subnetworks = weights.load(run)
    subnetworks["albedo"].get_layer("albedos").bias.assign([0.9, 0.1, 0.4, 0.2])
    weights.save(run / "model", architecture, subnetworks)
    changed = Estimator(run, ["albedo"]).estimate(PHOTO)
    told = capsys.readouterr()
    assert told.out == "" and told.err.startswith(f"{run} is exported to {run / 'onnx'}, once")
    Estimator(run)
    assert exports == [run] and capsys.readouterr().err == ""
    assert not np.allclose(changed.diffuse_albedo, first.diffuse_albedo, atol=0.05)
    keras = Estimator(run, ["albedo"], engine="keras").estimate(PHOTO)
    np.testing.assert_allclose(changed.diffuse_albedo, keras.diffuse_albedo, atol=1e-5)
    assert not [path for path in run.rglob("*") if path.name.startswith("partial-")]


def test_a_run_without_graphs_is_exported(run, tiny_model, monkeypatch, capsys):
    shutil.rmtree(run / "onnx")

    def export(folder, model_format, weights_folder):
        assert (folder, model_format, weights_folder) == (run, exporter.GRAPHS, run)
        shutil.copytree(tiny_model.parent / "onnx", folder / "onnx")

    monkeypatch.setattr(exporter, "export", export)
    expected = Estimator(tiny_model).estimate(PHOTO)
    assert Estimator(run).estimate(PHOTO).to_json() == expected.to_json()
    assert f"{run} is exported" in capsys.readouterr().err


class Without:
    """A finder of modules that does not have these."""

    def __init__(self, *names):
        self._names = names

    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in self._names:
            raise ImportError(f"{name} is kept away")


@pytest.mark.parametrize("missing", console.EXPORTING)
def test_a_run_that_cannot_be_exported_says_what_to_install(missing, run, exports, monkeypatch):
    shutil.rmtree(run / "onnx")
    monkeypatch.setattr(sys, "meta_path", [Without(missing), *sys.meta_path])
    monkeypatch.delitem(sys.modules, missing, raising=False)
    with pytest.raises(ImportError, match=rf"{run} must .* needs {missing}: pip .*\[train\]"):
        Estimator(run)
    assert not exports and not (run / "onnx").exists()


def test_the_keras_engine_says_what_to_install(run, monkeypatch):
    monkeypatch.setattr(sys, "meta_path", [Without("keras"), *sys.meta_path])
    monkeypatch.delitem(sys.modules, "keras", raising=False)
    with pytest.raises(ImportError, match=r"Keras engine needs keras: pip .*\[train\]"):
        engines.load(run, "keras")


def test_an_unknown_engine_is_refused(run):
    with pytest.raises(ValueError, match="no engine 'torch': choose from onnx, keras"):
        Estimator(run, engine="torch")


def test_the_engines_agree_on_what_they_run(tiny_model):
    onnx, keras = (engines.load(tiny_model, name) for name in engines.ENGINES)
    assert (onnx.size, onnx.system, onnx.outputs) == (keras.size, keras.system, keras.outputs)
    for outputs in ([], ["mask"], ["diffuse_albedo", "mirror"], list(onnx.outputs)):
        for given in (["image"], ["image", "mask"]):
            assert onnx.subnetworks(outputs, given) == keras.subnetworks(outputs, given)


def test_python_prints_nothing(tiny_model, tmp_path):
    """Neither does TensorFlow, which writes to standard error past Python."""
    np.save(tmp_path / "photo.npy", PHOTO)
    code = (
        "import sys, numpy, lime_keras\n"
        "for engine in ('onnx', 'keras'):\n"
        "    estimator = lime_keras.Estimator(sys.argv[1], engine=engine)\n"
        "    estimator.estimate(numpy.load(sys.argv[2]))\n"
    )
    command = [sys.executable, "-c", code, tiny_model, tmp_path / "photo.npy"]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert (answer.returncode, answer.stdout, answer.stderr) == (0, "", "")


def test_the_graphs_lie_where_the_export_writes_them(run):
    assert exporter.target(run, exporter.GRAPHS) == model_folder.graphs(run)
