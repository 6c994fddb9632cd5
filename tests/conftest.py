"""Fixtures that several test modules share."""

import dataclasses
import fcntl
import functools
import gc
import json
import os
import shutil
import sys
from pathlib import Path

import hypothesis
import pytest

from lime_keras.render.mitsuba_setup import variants

# The tests' own processes share the cores, and models this small gain nothing by more threads.
for name in ("OMP_NUM_THREADS", "TF_NUM_INTRAOP_THREADS", "TF_NUM_INTEROP_THREADS"):
    os.environ.setdefault(name, "1")

# This must come before any import of Mitsuba, whose library is chosen here, and of TensorFlow,
# which crashes if it is imported before Mitsuba.
CHOICE = variants.choose()
variants.activate(CHOICE, threads=1)

# Beside other work an example may take any time, so none is a failure for its time.
hypothesis.settings.register_profile("shared machine", deadline=None, max_examples=50)
hypothesis.settings.load_profile("shared machine")

LONGEST = (
    *("test_exporter.py", "test_trainer.py", "test_cli.py", "test_quickstart.py"),
    *("test_making.py", "test_suite.py", "test_loading.py", "test_split.py"),
    *("test_without_tensorflow.py", "test_stage_model.py", "test_pipeline.py"),
    *("test_predictions.py", "test_weights.py"),
)
TESTS = Path(__file__).parent
QUICK = (
    *("lime_keras/optics", "lime_keras/io", "lime_keras/lighting", "benchmarks"),
    *("lime_keras/test_losses.py", "lime_keras/test_metrics.py", "lime_keras/test_material.py"),
    *("lime_keras/model/test_folder.py", "lime_keras/networks/test_wiring.py"),
    *("lime_keras/video/test_fusion.py", "eval/accuracy/test_measures.py"),
    *("test_layout.py", "test_contributing.py"),
)
"""What `pytest -m quick` runs, below `tests/`: numbers, files and the order of imports."""


@functools.cache
def _is_quick(path):
    return any(path.is_relative_to(TESTS / place) for place in QUICK)


def pytest_ignore_collect(collection_path, config):
    """Let the quick part import its own files alone."""
    is_test = collection_path.name.startswith("test_")
    if is_test and config.option.markexpr == "quick" and not _is_quick(collection_path):
        return True
    return None


def pytest_collection_modifyitems(items):
    """The longest files first: every process takes whole files, and the last one keeps all."""
    items.sort(key=lambda item: item.path.name not in LONGEST)
    for item in items:
        takes_long = item.get_closest_marker("slow") or "wheel" in item.fixturenames
        if _is_quick(item.path) and not takes_long:
            item.add_marker("quick")


@pytest.fixture
def without(monkeypatch):
    """A function that keeps modules away."""

    class Away:
        def __init__(self, names):
            self.names = names

        def find_spec(self, name, path=None, target=None):
            if name.partition(".")[0] in self.names:
                raise ModuleNotFoundError(f"No module named {name!r}")

    def keep_away(*names):
        monkeypatch.setattr(sys, "meta_path", [Away(names), *sys.meta_path])
        for name in names:
            monkeypatch.delitem(sys.modules, name, raising=False)

    return keep_away


@pytest.fixture(scope="session")
def mitsuba_choice():
    """Return the fastest variant of Mitsuba that works here; it is active, with one thread."""
    return CHOICE


@pytest.fixture(params=["eager", "compiled"])
def differentiate(request):
    """Return a function that computes values and gradients of functions, as NumPy arrays.

    `differentiate(function, *arrays)` returns `(value, [gradient, …])`: the value, and the gradient
    of the value's sum by each array.
    """
    import tensorflow as tf

    @functools.cache
    def differentiated(function):
        def run(*variables):
            with tf.GradientTape() as tape:
                tape.watch(variables)
                value = function(*variables)
            gradients = tape.gradient(
                value, variables, unconnected_gradients=tf.UnconnectedGradients.ZERO
            )
            return value, gradients

        return tf.function(run) if request.param == "compiled" else run

    def evaluate(function, *arrays):
        value, gradients = differentiated(function)(*map(tf.constant, arrays))
        return value.numpy(), [gradient.numpy() for gradient in gradients]

    return evaluate


@pytest.fixture(scope="session")
def tiny():
    """Return the smallest architecture."""
    from lime_keras.networks import Architecture

    return Architecture(size=32, unet_width=2, unet_depth=1, encoder_width=2, dense_width=4)


@pytest.fixture(scope="session")
def shared(tmp_path_factory):
    """What takes long to make, made once for all processes of a run.

    `shared(name, make)` is a folder that `make`, called with its path, has filled.
    """
    base = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent

    def folder(name, make):
        path = base / f"shared-{name}"
        with (base / f"{path.name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not path.exists():
                partial = base / f"partial-{path.name}-{os.getpid()}"
                make(partial)
                partial.rename(path)
        return path

    return folder


@pytest.fixture(scope="session")
def tiny_model(tiny, shared):
    """Return the folder of an untrained tiny model, exported; its outputs vary with the image."""
    return shared("tiny", lambda folder: _saved(folder / "model", tiny, seed=11)) / "model"


@pytest.fixture
def run(tiny_model, tmp_path):
    """Return a copy of the exported tiny model, to change."""
    return shutil.copytree(tiny_model.parent, tmp_path / "run")


@pytest.fixture(scope="session")
def corpus(shared):
    """Return a corpus of spheres of 32 pixels: two train shards of 4 and 2, one test shard of 4."""
    import sphere_corpus

    def make(folder):
        sphere_corpus.write_split(folder, "train", [range(4), range(4, 6)], size=32)
        sphere_corpus.write_split(folder, "test", [range(4)], seed=1, size=32)

    return shared("corpus", make)


@pytest.fixture
def sets(tiny_model, tmp_path, monkeypatch):
    """`sets(*names)`: lets tiny models of these names come with the package; returns their folder.

    As in the package, their weights lie in their graphs alone.
    """
    from lime_keras.model import folder as model_folder

    def come_with_the_package(*names):
        folder = tmp_path / "pretrained"
        for name in names:
            model = folder / name / "model"
            model.mkdir(parents=True)
            shutil.copyfile(tiny_model / "architecture.json", model / "architecture.json")
            shutil.copytree(tiny_model.parent / "onnx", folder / name / "onnx")
        monkeypatch.setattr(model_folder, "PRETRAINED", folder)
        for one in ("DEFAULT", "FOR_PHOTOS"):
            monkeypatch.setattr(model_folder, one, folder / getattr(model_folder, one).name)
        return folder

    return come_with_the_package


@pytest.fixture(scope="session")
def tiny_export(shared, tiny_model):
    """`tiny_export(format)`: a folder of `exporter.export`, and what that told of `tiny_model`."""
    from lime_keras.export import exporter

    def export(model_format):
        def make(folder):
            told = exporter.export(folder / "deep" / "folder", model_format, tiny_model)
            (folder / "told.json").write_text(json.dumps(told, default=float), encoding="utf-8")

        folder = shared(model_format, make)
        told = json.loads((folder / "told.json").read_text(encoding="utf-8"))
        return folder / "deep" / "folder", told

    return export


ABLATIONS = {
    "without MirrorNet": {"mirror": False},
    "regression": {"exponent": "regression"},
    "baseline": {"system": "reflectance-map"},
}


def _ablations():
    """Yield the names of the ablations; the one that differs most is not slow."""
    for name in ABLATIONS:
        yield pytest.param(name, marks=() if name == "baseline" else pytest.mark.slow)


@pytest.fixture(scope="session", params=_ablations())
def ablation(request, tiny):
    """Return the smallest architecture of each ablation."""
    return dataclasses.replace(tiny, **ABLATIONS[request.param])


@pytest.fixture(scope="session")
def ablation_model(ablation, shared):
    """Return the folder of an untrained tiny model of each ablation (see `tiny_model`)."""
    name = ablation.description.replace(" ", "-")
    return shared(name, lambda folder: _saved(folder / "model", ablation, seed=3)) / "model"


@pytest.fixture(scope="session")
def split_model(tiny, shared):
    """Return the folder of an untrained tiny model that splits colours, in linear radiance."""
    split = dataclasses.replace(tiny, dichromatic=True, linear=True, mask_contrast=False)
    return shared("split", lambda folder: _saved(folder / "model", split, seed=3)) / "model"


def _saved(folder, architecture, seed):
    """Save a model with random weights of a seed, chosen so that all outputs vary; export it."""
    import keras
    import lifted_heads

    from lime_keras.export.exporter import GRAPHS, export
    from lime_keras.model import weights
    from lime_keras.networks import build

    keras.utils.set_random_seed(seed)
    weights.save(folder, architecture, lifted_heads.lift(build(architecture)))
    export(folder.parent, GRAPHS, folder)


def pytest_collection_finish():
    """Spare the garbage collector what was imported, which it would walk through each time."""
    gc.freeze()
    gc.set_threshold(100_000, 50, 50)  # tracing networks makes many objects, and few circles


def pytest_sessionfinish():
    gc.unfreeze()  # or nanobind takes what is left for leaks
