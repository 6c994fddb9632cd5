"""Runs from banks: resumed exactly, with corpora or without, and stopped by a scene that breaks."""

import dataclasses
import json

import noise_bank
import numpy as np
import pytest
import stage_runs
from sphere_corpus import write_split

from lime_keras.model import weights
from lime_keras.train import stage_training, trainer
from lime_keras.train.evaluation import evaluation_path
from lime_keras.train.sources import banks


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paths")
    write_split(folder / "corpus", "train", [range(4), range(4, 8)], size=32)
    noise_bank.write(folder / "bank")
    return folder


@pytest.fixture(autouse=True)
def noise(monkeypatch):
    monkeypatch.setattr(banks, "scenes", noise_bank)


@pytest.mark.parametrize(
    "names", [pytest.param(["bank"], marks=pytest.mark.slow), ["bank", "corpus"]]
)
def test_a_run_is_resumed_bit_for_bit(names, paths, tmp_path, monkeypatch):
    monkeypatch.setattr(stage_training, "_SECONDS_BETWEEN_CHECKPOINTS", 0)
    found = [paths / name for name in names]
    config = stage_runs.config(*found)
    only = ["exponent"]
    trainer.train(found, tmp_path / "whole", config, stage_runs.ignore, only=only)
    with pytest.raises(KeyboardInterrupt):
        interrupt = stage_runs.interrupted_at("exponent", 2)
        trainer.train(found, tmp_path / "broken", config, interrupt, only=only)
    assert stage_runs.left(tmp_path / "broken", "exponent")["step"] == 2
    trainer.train(found, tmp_path / "broken", config, stage_runs.ignore, only=only)
    whole, resumed = (stage_runs.left(tmp_path / run, "exponent") for run in ("whole", "broken"))
    assert whole.keys() == resumed.keys()
    for name, expected in whole.items():
        assert np.array_equal(resumed[name], expected), name


def test_the_record_names_the_banks(paths, tmp_path):
    found = [paths / "bank"]
    config = stage_runs.config(*found)
    untrained = trainer.train(found, tmp_path, config, stage_runs.ignore, only=["exponent"])
    assert untrained == ["segmentation", "specular", "mirror", "albedo"]
    _, trained = weights.load(tmp_path, whole=False)
    assert list(trained) == ["exponent"] and not evaluation_path(tmp_path).exists()
    record = json.loads((tmp_path / "config.json").read_text(encoding="utf-8"))
    assert record["corpora"] == [
        {"path": str(paths / "bank"), "description": {"split": "train", "seed": 5}}
    ]
    other = [noise_bank.write(tmp_path / "other", digest="9")]
    with pytest.raises(ValueError, match="corpus_sha256"):
        trainer.train(other, tmp_path, stage_runs.config(*other), stage_runs.ignore)


def test_the_scene_that_breaks_a_step_is_named(paths, tmp_path, monkeypatch):
    """In the third batch, which is the bank's second."""
    honest = noise_bank.training

    def broken(*arguments, **options):
        for step, batch in enumerate(honest(*arguments, **options)):
            batch["ambient"][1] = 3e38 if step == 1 else 0.0
            yield batch

    monkeypatch.setattr(noise_bank, "training", broken)
    found = [paths / "bank", paths / "corpus"]
    clean = stage_runs.config(*found, camera=False)
    schedule = dataclasses.replace(stage_runs.BRIEF, encoder_steps=6)
    expected = (
        r"stage albedo, step 4: .*compositing.* not finite; from scene at position 5 of seed \d+ "
        rf"of bank {paths / 'bank'}: check the bank with `lime-render verify .*last checkpoint"
    )
    with pytest.raises(RuntimeError, match=expected):
        trainer.train(
            found,
            tmp_path / "run",
            dataclasses.replace(clean, schedule=schedule),
            stage_runs.ignore,
            only=["albedo"],
        )
