"""A machine that has JAX alone trains from banks, and says what it cannot do."""

import json

import noise_bank
import pytest
import sphere_bank
import without_tensorflow
from sphere_corpus import write_split
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from lime_keras.model import weights

pytest.importorskip("jax")


@pytest.mark.slow
def test_a_bank_is_trained_from(tmp_path):
    bank, run = noise_bank.write(tmp_path / "bank"), tmp_path / "run"
    begin = ["noise", bank, "--out", run, "--preset", "smoke", "--batch-size", "4"]
    done = without_tensorflow.start(*begin, "--stages", "exponent")
    assert done.returncode == 0, done.stderr[-4000:]
    assert "5/8 exponent: 100%" in done.stderr
    _, trained = weights.load(run, whole=False)
    assert list(trained) == ["exponent"]
    record = json.loads((run / "config.json").read_text(encoding="utf-8"))
    assert record["backend"] == "jax" and record["config"]["schedule"]["batch_size"] == 4
    events = EventAccumulator(str(run / "tensorboard" / "5-exponent")).Reload()
    assert "held out/exponent" in events.Tags()["tensors"]


@pytest.mark.parametrize(
    "backend, expected",
    [
        ("jax", "corpus holds records, or is an incomplete bank: install TensorFlow to read"),
        ("tensorflow", "set KERAS_BACKEND=jax to train from banks without it"),
    ],
)
def test_what_needs_tensorflow_says_so(backend, expected, tmp_path):
    bank = noise_bank.write(tmp_path / "bank")
    corpus = write_split(tmp_path / "corpus", "train", [range(1)], size=32)
    path = corpus if backend == "jax" else bank
    done = without_tensorflow.start(
        "noise", path, "--out", tmp_path / "run", "--preset", "smoke", backend=backend
    )
    assert done.returncode == 1
    assert f"error: TensorFlow is not installed; {path if backend == 'jax' else ''}" in done.stderr
    assert expected in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("options", [[], ["--baseline", "reflectance-map"]])
def test_all_stages_are_trained_from_scenes(options, tmp_path):
    bank, run = sphere_bank.write(tmp_path / "bank"), tmp_path / "run"
    done = without_tensorflow.start("scenes", bank, "--out", run, "--preset", "smoke", *options)
    assert done.returncode == 0, done.stderr[-4000:]
    weights.load(run)
    found = json.loads((run / "evaluation.json").read_text(encoding="utf-8"))
    assert found["examples"] == 2 and 0 <= found["measures"]["mask_iou_pooled"] <= 1
    assert "whole system" in done.stdout
