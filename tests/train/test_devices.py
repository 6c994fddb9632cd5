"""A batch split between two devices trains as it does on one, under TensorFlow and JAX."""

import json

import numpy as np
import pytest
import stage_runs
from sphere_corpus import alter, write_split

from lime_keras.train import trainer
from lime_keras.train.devices import Devices


@pytest.fixture(scope="module")
def corpora(tmp_path_factory):
    """A corpus, and beside it one of which an example holds a number that is none."""
    folder = tmp_path_factory.mktemp("corpora")
    write_split(folder / "corpus", "train", [range(8), range(8, 13)], size=32)
    write_split(folder / "broken", "train", [range(8), range(8, 13)], size=32)
    alter(folder / "broken" / "train", 3, "ambient", 3e38)
    return folder


@pytest.fixture(scope="module", params=["tensorflow", "jax"])
def runs(request, corpora, tmp_path_factory):
    """Folder of what a process with two devices left under a backend."""
    if request.param == "jax":
        pytest.importorskip("jax")
    folder = tmp_path_factory.mktemp(request.param)
    for corpus in corpora.iterdir():
        (folder / corpus.name).symlink_to(corpus)
    environment = {
        "KERAS_BACKEND": request.param,
        "XLA_FLAGS": "--xla_force_host_platform_device_count=2 --xla_backend_optimization_level=0",
    }
    stage_runs.start("devices", folder, environment)
    return folder


def _state(run):
    """Weights and moments, and apart from them the gradients' norm."""
    with np.load(run / "stages" / "4-albedo.npz") as stored:
        *state, norm = (stored[f"arr_{index}"] for index in range(len(stored.files) - 2))
    return state, norm


def _left(runs):
    return json.loads((runs / "left.json").read_text(encoding="utf-8"))


def _curve(run):
    rows = stage_runs.curve(run, "albedo")
    return [{name: float(value or 0) for name, value in row.items()} for row in rows]


@pytest.mark.slow
def test_losses_are_those_of_one_device(runs):
    one, two = _curve(runs / "one"), _curve(runs / "two")
    assert [row["step"] for row in two] == list(range(6))
    assert one[-1]["validation_loss"] < one[0]["validation_loss"]
    for expected, row in zip(one, two, strict=True):
        for name in row.keys() - {"seconds"}:
            assert row[name] == pytest.approx(expected[name], rel=1e-4), name


@pytest.mark.slow
def test_measures_are_those_of_one_device(runs):
    """Of batches that are shared out and of one that each device sees whole, in either backend."""
    two, one = _left(runs)["measured"]
    assert len(one) == 8 and 0 < one["mask_iou_pooled"] < 1
    assert two == pytest.approx(one, rel=1e-4)
    assert one == pytest.approx(stage_runs.measured(Devices(1)), rel=1e-3)


@pytest.mark.slow
def test_weights_are_those_of_one_device(runs):
    (one, _), (two, _) = _state(runs / "one"), _state(runs / "two")
    for expected, found in zip(one, two, strict=True):
        assert np.allclose(found, expected, rtol=1e-3, atol=1e-5)


@pytest.mark.slow
def test_the_norm_of_a_split_gradient_is_not_that_of_a_part(runs):
    """TensorFlow's devices each know the norm of their part; its sum is an upper bound."""
    (_, one), (_, two) = _state(runs / "one"), _state(runs / "two")
    assert 0.999 * one < two < 1.5 * one


@pytest.mark.slow
@pytest.mark.parametrize("runs", ["tensorflow"], indirect=True)
def test_half_precision_trains(runs):
    """Only TensorFlow's devices must agree on a loss scale."""
    state, norm = _state(runs / "half")
    assert all(np.all(np.isfinite(one)) for one in state)
    assert np.isfinite(norm) and norm > 0
    before, after = _curve(runs / "half")[0], _curve(runs / "half")[-1]
    assert after["validation_loss"] < before["validation_loss"]


@pytest.mark.slow
def test_an_overflow_on_any_device_holds_the_step_back(runs):
    """Keras asks the first of TensorFlow's alone."""
    scale, steps, weight = _left(runs)["overflow"]
    assert scale == 2.0**119
    assert (steps, weight) == (0, 1)


@pytest.mark.slow
def test_the_example_that_breaks_a_step_is_named(runs):
    found = _left(runs)["broken"]
    assert found.startswith("RuntimeError: stage albedo, step ")
    assert "from example 3 of seed 0 of the train split: render it again" in found


@pytest.mark.slow
def test_more_devices_than_there_are_is_refused(runs):
    found = _left(runs)["three"]
    assert found.startswith("ValueError: --devices 3, but ")
    assert " sees 2: " in found


def test_a_process_with_one_device_names_it():
    with pytest.raises(ValueError, match=r"--devices 9, but tensorflow sees \d+: /device:"):
        Devices(9)


@pytest.mark.parametrize("count", [3, 0, -1])
def test_a_batch_that_cannot_be_dealt_out_is_refused(count, corpora, tmp_path):
    corpus = corpora / "corpus"
    with pytest.raises(ValueError, match=f"batches of 4 cannot be split between {count} devices"):
        trainer.train(
            [corpus], tmp_path, stage_runs.config(corpus), stage_runs.ignore, devices=count
        )
    assert not list(tmp_path.iterdir())
