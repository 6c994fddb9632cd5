"""The engines that a model's folder is loaded with, and what is told where it cannot be."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

from lime_keras import Estimator
from lime_keras.export import exporter
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.model.folder import ENGINES
from lime_keras.runtime import engine as runtime

PHOTO = np.random.default_rng(0).uniform(size=(40, 90, 3)).astype(np.float32)


def change_weights(run):
    architecture, subnetworks = weights.load(run)
    subnetworks["albedo"].get_layer("albedos").bias.assign([0.9, 0.1, 0.4, 0.2])
    weights.save(run / "model", architecture, subnetworks)


def test_graphs_that_are_not_there_are_named_with_the_command(run):
    change_weights(run)
    told = f": run `lime-export {run} --format graphs --weights {run}`"
    with pytest.raises(ValueError, match=f"holds graphs of other weights{told}"):
        Estimator(run)
    shutil.rmtree(run / "onnx")
    with pytest.raises(ValueError, match=f"holds no graphs{told}"):
        Estimator(run)


def test_another_precision_has_graphs_of_its_own(run, tiny_model):
    """They lie beside those in float32, and are written by the command that is named."""
    told = f"onnx-float16 holds no graphs: run `lime-export {run} --format graphs --weights {run} "
    with pytest.raises(ValueError, match=f"{told}--precision float16`"):
        Estimator(run, precision="float16")
    exporter.export(run, exporter.GRAPHS, tiny_model, precision="float16")
    expected, found = (Estimator(run, precision=p).estimate(PHOTO) for p in ("float32", "float16"))
    np.testing.assert_allclose(found.diffuse_albedo, expected.diffuse_albedo, atol=5e-3)
    assert not np.array_equal(found.diffuse_albedo, expected.diffuse_albedo)
    assert not [path for path in run.rglob("*") if path.name.startswith("partial-")]


def test_graphs_in_a_new_folder_are_a_model_of_their_own(tiny_model, tiny_export):
    folder, _ = tiny_export(exporter.GRAPHS)
    expected = Estimator(tiny_model).estimate(PHOTO)
    for engine in ENGINES:
        found = Estimator(folder, engine=engine).estimate(PHOTO)
        np.testing.assert_allclose(found.diffuse_albedo, expected.diffuse_albedo, atol=1e-5)


def test_sets_of_the_package_name_the_command(monkeypatch):
    with pytest.raises(ValueError, match=r"lime-export OUT --format graphs --weights nano .*int8"):
        Estimator("nano", precision="int8")


def test_the_keras_engine_says_what_to_install(run, without):
    without("keras")
    with pytest.raises(ImportError, match=r"Keras engine needs keras: pip .*\[train\]"):
        runtime.load(run, "keras")


def test_an_unknown_engine_is_refused(run):
    with pytest.raises(ValueError, match="no engine 'torch': choose from onnx, keras"):
        Estimator(run, engine="torch")
    with pytest.raises(ValueError, match="no precision 'int4': choose from float32, "):
        Estimator(run, precision="int4")
    with pytest.raises(ValueError, match="Keras computes in float32, not in int8"):
        Estimator(run, engine="keras", precision="int8")


def test_the_engines_agree_on_what_they_run(tiny_model):
    onnx, keras = (runtime.load(tiny_model, name) for name in ENGINES)
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
