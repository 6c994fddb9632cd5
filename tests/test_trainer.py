"""Runs: resumed exactly, refused where they differ, stopped where they break."""

import csv
import dataclasses
import json
import shutil

import numpy as np
import pytest
import tensorflow as tf
from sphere_corpus import write_split

from lime_keras import weights
from lime_keras.networks import SUBNETWORKS, Architecture
from lime_keras.train import cli, trainer
from lime_keras.train.config import Config, corpus_sha256
from lime_keras.train.stages import SINGLE, Schedule, Stage
from lime_keras.train.state import MeanLosses

TINY = Architecture(size=32, unet_width=2, unet_depth=2, encoder_width=2, dense_width=4)
BRIEF = Schedule(
    batch_size=2,
    single_steps=dict.fromkeys(SINGLE, 2),
    single_learning_rate=1e-3,
    joint_steps=4,
    joint_learning_rate=1e-3,
    validation_examples=2,
)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return write_split(tmp_path_factory.mktemp("corpus"), "train", [range(6), range(6, 9)])


@pytest.fixture(scope="module")
def config(corpus):
    return Config("tiny", TINY, BRIEF, 0, corpus_sha256(corpus), camera=True)


@pytest.fixture(scope="module")
def finished(corpus, config, tmp_path_factory):
    run = tmp_path_factory.mktemp("finished")
    trainer.train(corpus, run, config, _ignore)
    return run


def _ignore(stage, step, losses):
    pass


def _weights(run):
    _, subnetworks = weights.load(run)
    return {name: network.get_weights() for name, network in subnetworks.items()}


def _same(one, other):
    return all(
        np.array_equal(a, b)
        for name in SUBNETWORKS
        for a, b in zip(one[name], other[name], strict=True)
    )


def test_a_run_leaves_a_model_and_its_curves(finished):
    assert set(_weights(finished)) == set(SUBNETWORKS)
    curves = sorted(path.name for path in (finished / "curves").iterdir())
    assert curves[0] == "1-segmentation.csv"
    assert len(curves) == 8
    with (finished / "curves" / curves[-1]).open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["step"]) for row in rows] == [0, 1, 2, 3, 4]
    assert float(rows[-1]["train_compositing"]) > 0
    assert float(rows[0]["validation_loss"]) > 0


@pytest.mark.parametrize("stage_and_step", [("mirror", 1), ("specular+mirror+exponent", 3)])
def test_an_interrupted_run_ends_with_the_same_weights(
    stage_and_step, corpus, config, finished, tmp_path, monkeypatch
):
    monkeypatch.setattr(trainer, "_SECONDS_BETWEEN_CHECKPOINTS", 0)

    def interrupt(stage, step, losses):
        if (stage.name, step) == stage_and_step:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trainer.train(corpus, tmp_path, config, interrupt)
    trainer.train(corpus, tmp_path, config, _ignore)
    assert _same(_weights(tmp_path), _weights(finished))
    for path in (finished / "curves").iterdir():
        with (
            path.open(encoding="utf-8") as file,
            (tmp_path / "curves" / path.name).open(encoding="utf-8") as other,
        ):
            expected = [row["step"] for row in csv.DictReader(file)]
            assert [row["step"] for row in csv.DictReader(other)] == expected


def test_curves_hold_means_over_their_interval(corpus, config, tmp_path, monkeypatch):
    """Not the last batch's losses, which is what Keras tells."""
    monkeypatch.setattr(trainer, "_CURVE_POINTS", 1)
    seen = []
    one_stage = dataclasses.replace(config.schedule, single_steps={"segmentation": 4})
    monkeypatch.setattr(type(one_stage), "stages", lambda self: [Stage(("segmentation",), 4, 0.1)])
    trainer.train(
        corpus,
        tmp_path,
        dataclasses.replace(config, schedule=one_stage),
        lambda stage, step, losses: seen.append(losses.get("mask")),
    )
    with (tmp_path / "curves" / "1-segmentation.csv").open(encoding="utf-8") as file:
        last = list(csv.DictReader(file))[-1]
    # What is told after each step is the mean so far; undo it to have each batch's loss.
    means = np.array(seen[1:], float)
    batches = np.diff(means * np.arange(1, 5), prepend=0)
    assert float(last["train_mask"]) == pytest.approx(batches.mean(), rel=1e-4)
    assert batches.std() > 1e-6


def test_a_finished_run_is_not_trained_again(corpus, config, finished):
    seen = []
    trainer.train(corpus, finished, config, lambda *told: seen.append(told))
    assert [(stage.name, step) for stage, step, _ in seen] == [
        (stage.name, stage.steps) for stage in BRIEF.stages()
    ]


def test_another_seed_gives_other_weights(corpus, config, finished, tmp_path):
    trainer.train(corpus, tmp_path, dataclasses.replace(config, seed=1), _ignore)
    assert not _same(_weights(tmp_path), _weights(finished))


def test_another_config_is_refused_with_the_difference(corpus, config, finished):
    other = dataclasses.replace(config, seed=7)
    with pytest.raises(ValueError, match="seed 0 there, 7 asked"):
        trainer.train(corpus, finished, other, _ignore)


def test_what_was_run_is_recorded(config, finished):
    record = json.loads((finished / "config.json").read_text(encoding="utf-8"))
    assert record["config"]["corpus_sha256"] == config.corpus_sha256
    assert record["config"]["schedule"]["joint_steps"] == 4
    assert {"tensorflow", "keras", "numpy"} == set(record["packages"])


def test_a_loss_that_is_not_finite_stops_the_run_before_its_checkpoint(
    corpus, config, tmp_path, monkeypatch
):
    monkeypatch.setitem(trainer.StageModel.__init__.__globals__["WEIGHTS"], "specular", np.nan)
    with pytest.raises(RuntimeError, match="stage specular, step 1: loss not finite"):
        trainer.train(corpus, tmp_path, config, _ignore)
    assert not (tmp_path / "stages" / "2-specular.npz").exists()


@pytest.mark.parametrize("shard, record", [(0, 4), (1, 0)])
def test_damage_stops_the_run_by_name(corpus, config, tmp_path, shard, record):
    """In an example to train on, and in one that is held out."""
    shutil.copytree(corpus, tmp_path / "corpus")
    path = tmp_path / "corpus" / "train" / f"{shard:05d}.tfrecord"
    whole = [serialized.numpy() for serialized in tf.data.TFRecordDataset(str(path))]
    position = sum(16 + len(serialized) for serialized in whole[:record]) + len(whole[record]) // 2
    data = bytearray(path.read_bytes())
    data[position] ^= 1
    path.write_bytes(data)
    expected = rf"{path} is broken: record {record} .*delete the file.*lime-render"
    with pytest.raises(ValueError, match=expected):
        trainer.train(tmp_path / "corpus", tmp_path / "run", config, _ignore)


def test_the_camera_is_on_unless_refused(corpus, config, finished, tmp_path, monkeypatch):
    required = [str(corpus), "--out", str(tmp_path), "--preset", "smoke"]
    assert cli.parser().parse_args(required).camera
    assert not cli.parser().parse_args([*required, "--no-camera"]).camera
    clean = dataclasses.replace(config, camera=False)
    with pytest.raises(ValueError, match="camera True there, False asked"):
        trainer.train(corpus, finished, clean, _ignore)
    monkeypatch.setattr(Schedule, "stages", lambda self: [Stage(("segmentation",), 2, 1e-3)])
    trainer.train(corpus, tmp_path, clean, _ignore)
    rows = []
    for run in (tmp_path, finished):
        with (run / "curves" / "1-segmentation.csv").open(encoding="utf-8") as file:
            rows.append(list(csv.DictReader(file))[-1])
    # What is trained on and what is held out are seen alike.
    for losses in ("train_mask", "validation_mask"):
        assert rows[0][losses] != rows[1][losses]


def test_one_shard_cannot_be_split(config, tmp_path):
    corpus = write_split(tmp_path, "train", [range(2)])
    with pytest.raises(ValueError, match="at least 2"):
        trainer.train(corpus, tmp_path / "run", config, _ignore)


def test_the_command_names_what_is_missing(tmp_path, capsys):
    status = cli.main([str(tmp_path), "--out", str(tmp_path / "run"), "--preset", "smoke"])
    assert status == 1
    assert "lime-render" in capsys.readouterr().err


def test_mean_losses():
    losses = MeanLosses()
    for value in (1.0, 2.0, 6.0):
        losses.add({"mask": value})
    assert losses.means() == {"mask": 3.0}
