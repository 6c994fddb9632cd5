"""Under JAX the same weights answer and learn the same as under TensorFlow."""

import json

import keras
import numpy as np
import pytest
import stage_runs
from sphere_corpus import write_split

from lime_keras.data import pipeline
from lime_keras.data.corpus import Split
from lime_keras.model import weights
from lime_keras.networks import build, subnetwork_names
from lime_keras.train import stage_training, trainer

# JAX compiles every stage of every system, which takes minutes; that it trains at all, `make test`
# sees in test_devices.py.
pytestmark = pytest.mark.slow

pytest.importorskip("jax")


@pytest.fixture(scope="module")
def exchanged(tmp_path_factory):
    """Folder of what was handed to a process under JAX, and of what that left."""
    folder = tmp_path_factory.mktemp("exchanged")
    corpus = write_split(folder / "corpus", "train", [range(8), range(8, 13)], size=32)
    features = [name for name in pipeline.FEATURES if name not in ("shape", "light")]
    dataset = pipeline.evaluation(
        Split(corpus, "train").shard_paths(), size=32, batch_size=3, features=features
    )
    batch = {name: value.numpy() for name, value in next(iter(dataset)).items()}
    batch["painted"] = np.zeros_like(batch["mask"])
    np.savez(folder / "batch.npz", **batch)
    for name, architecture in stage_runs.SYSTEMS.items():
        weights.save(folder / name, architecture, _alive(architecture))
    config = stage_runs.config(corpus)
    trainer.train([corpus], folder / "unbroken", config, stage_runs.ignore, only=["specular"])
    with pytest.MonkeyPatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(stage_training, "_SECONDS_BETWEEN_CHECKPOINTS", 0)
        interrupt = stage_runs.interrupted_at("specular", 1)
        trainer.train([corpus], folder / "begun", config, interrupt, only=["specular"])
    environment = {
        "KERAS_BACKEND": "jax",
        # Compiled in a third of the time, whatever it then takes to run.
        "XLA_FLAGS": "--xla_backend_optimization_level=0",
        "JAX_COMPILATION_CACHE_DIR": str(folder / "compiled"),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }
    stage_runs.start("backend", folder, environment)
    return folder


def _alive(architecture):
    """Subnetworks whose every unit answers: the heads start where masks and albedos are clipped."""
    subnetworks = build(architecture, seed=3)
    for network in subnetworks.values():
        for layer in network.layers:
            if getattr(layer, "use_bias", False):
                layer.bias.assign(np.full(layer.bias.shape, 0.3))
            if layer.name == "albedos":
                layer.kernel.assign(0.1 * layer.kernel)
    return subnetworks


@pytest.fixture(params=stage_runs.SYSTEMS)
def system(request):
    return request.param


def test_weights_come_back_as_they_went(system, exchanged):
    (went, before), (came, after) = (
        weights.load(exchanged / system),
        weights.load(exchanged / f"back-{system}"),
    )
    assert went == came
    for name, network in before.items():
        for one, other in zip(network.get_weights(), after[name].get_weights(), strict=True):
            assert np.array_equal(one, other)


def test_answers_are_the_same(system, exchanged):
    here, there = (
        stage_runs.answers(exchanged / system),
        np.load(exchanged / f"answers-{system}.npz"),
    )
    assert set(here) == set(there.files)
    for name, expected in here.items():
        assert np.ptp(expected) > 0, name  # not clipped
        assert np.allclose(there[name], expected, rtol=1e-4, atol=1e-5), name


def test_every_stage_has_the_same_losses_and_gradients(system, exchanged):
    batch = dict(np.load(exchanged / "batch.npz"))
    here = stage_runs.first_steps(exchanged / system, batch, system)
    there = np.load(exchanged / f"steps-{system}.npz")
    assert set(here) == set(there.files)
    stages = stage_runs.stages(system)
    assert {key.split("|")[0] for key in here} == {stage.name for stage in stages}
    moved = []
    for key, expected in here.items():
        scale = np.abs(expected).max()
        if "|gradient|" in key:
            moved.append(scale > 0)
        assert np.allclose(there[key], expected, rtol=1e-4, atol=1e-4 * scale + 1e-7), key
    assert np.mean(moved) > 0.9


def test_a_run_ends_with_a_model(exchanged):
    found, subnetworks = weights.load(exchanged / "whole")
    assert found == stage_runs.SYSTEMS["baseline"]
    assert set(subnetworks) == set(subnetwork_names(found))
    stages = stage_runs.BRIEF.stages(found)
    assert len(list((exchanged / "whole" / "stages").iterdir())) == len(stages)
    record = json.loads((exchanged / "whole" / "config.json").read_text(encoding="utf-8"))
    assert record["backend"] == "jax"


def test_an_interrupted_run_ends_with_the_same_weights(exchanged):
    for path in sorted((exchanged / "whole" / "stages").iterdir()):
        with np.load(path) as one, np.load(exchanged / "resumed" / "stages" / path.name) as other:
            assert set(one.files) == set(other.files)
            for name in one.files:
                assert np.array_equal(one[name], other[name]), (path.name, name)


def test_a_run_begun_under_tensorflow_is_carried_on(exchanged):
    """With the same batches and nearly the same weights, and the record of where it began."""
    told = json.loads((exchanged / "carried-on.json").read_text(encoding="utf-8"))
    assert told == [1, 2, 3]
    begun, unbroken = (
        stage_runs.curve(exchanged / run, "specular") for run in ("begun", "unbroken")
    )
    assert [row["step"] for row in begun] == ["0", "1", "2", "3"]
    # Between checkpoint and end the two differ by rounding, which Adam may make a whole step.
    for row, expected in zip(begun, unbroken, strict=True):
        for name in row.keys() - {"step", "seconds"}:
            if row[name]:
                assert float(row[name]) == pytest.approx(float(expected[name]), rel=1e-4)
    record = json.loads((exchanged / "begun" / "config.json").read_text(encoding="utf-8"))
    assert record["backend"] == keras.backend.backend() == "tensorflow"
