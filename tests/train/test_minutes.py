"""Runs within minutes, by a clock that the test moves: batches take 1 s, evaluations a quarter."""

import dataclasses
import math
from itertools import pairwise

import noise_bank
import numpy as np
import pytest
import stage_runs

from lime_keras.model import weights
from lime_keras.train import budget, pace, stage_training, trainer
from lime_keras.train.config import config_path
from lime_keras.train.sources import banks
from lime_keras.train.stage_training import StageTraining

STAGES = ["albedo", "exponent"]


class Run:
    """A run in fake time, with what was learnt at which rate and when."""

    def __init__(self, folder, monkeypatch):
        self.now = 500.0
        for module in (budget, pace, stage_training, trainer):
            monkeypatch.setattr(module, "monotonic", lambda: self.now)
        self.bank, self.out = noise_bank.write(folder / "bank"), folder / "run"
        self.rates, self.told = {}, []
        step, evaluate = StageTraining._step, StageTraining._evaluate

        def timed_step(training, batch):
            losses = step(training, batch)
            rate = float(training._model.optimizer.learning_rate)
            self.rates.setdefault(training._stage.name, []).append(rate)
            self.now += 1.0
            return losses

        def timed_evaluation(training, batch):
            self.now += 0.25
            return evaluate(training, batch)

        monkeypatch.setattr(StageTraining, "_step", timed_step)
        monkeypatch.setattr(StageTraining, "_evaluate", timed_evaluation)

    def train(self, minutes, tell=None, startup=5.0, **options):
        """Train, and return the seconds that the command took."""
        began = self.now
        self.now += startup
        self.rates.clear()
        config = stage_runs.config(self.bank, minutes=minutes)
        schedule = dataclasses.replace(config.schedule, encoder_steps=100)

        def note(progress):
            self.told.append(progress)
            if tell is not None:
                tell(progress)

        trainer.train(
            [self.bank],
            self.out,
            dataclasses.replace(config, schedule=schedule),
            note,
            began=began,
            **({"only": STAGES} | options),
        )
        return self.now - began


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.setattr(banks, "scenes", noise_bank)
    return Run(tmp_path, monkeypatch)


_MEASURED = 4
"""Number of batches by which a stage is measured, before any is trained."""


def test_a_run_ends_in_time_and_its_rates_at_nothing(run):
    taken = run.train(1)
    assert 54 < taken <= 60
    for rates in run.rates.values():
        learnt = rates[_MEASURED:]
        assert learnt[0] == pytest.approx(1e-3, rel=0.01)
        assert all(later < earlier for earlier, later in pairwise(learnt))
        assert learnt[-1] < 0.02e-3
    lengths = [len(run.rates[name]) for name in STAGES]
    # Stages with as many batches of the same cost have about as much of the time.
    assert abs(lengths[0] - lengths[1]) <= 2 and min(lengths) > 15
    compiled = [told.compiled for told in run.told if told.compiled]
    assert compiled == [(0, 2), (1, 2), (2, 2)]
    assert [told.left for told in run.told] == sorted(
        (told.left for told in run.told), reverse=True
    )


def test_measuring_a_stage_leaves_no_trace(run, monkeypatch):
    before, after = [], []
    measure = StageTraining.measure

    def spied(training):
        before.append([np.array(value) for value in training._model.get_weights()])
        cost = measure(training)
        after.append([np.array(value) for value in training._model.get_weights()])
        assert int(training._model.optimizer.iterations) == 0
        assert cost.step == pytest.approx(1.0)
        raise KeyboardInterrupt

    monkeypatch.setattr(StageTraining, "measure", spied)
    with pytest.raises(KeyboardInterrupt):
        run.train(1)
    assert len(before[0]) == len(after[0])
    for one, other in zip(before[0], after[0], strict=True):
        assert np.array_equal(one, other)


@pytest.mark.slow
def test_a_resumed_run_goes_on_with_what_is_left(run, monkeypatch):
    monkeypatch.setattr(stage_training, "_SECONDS_BETWEEN_CHECKPOINTS", 0)

    def interrupt(progress):
        if progress.stage.name == "exponent" and progress.done > 0.5:
            raise KeyboardInterrupt

    began = run.now
    with pytest.raises(KeyboardInterrupt):
        run.train(2, interrupt)
    first = run.now - began
    before = run.rates["exponent"][-1]
    taken = run.train(2)
    # What came after the last checkpoint is lost, and what starting anew took is gone.
    assert 112 < first + taken <= 120 + 2
    assert list(run.rates) == ["exponent"]
    learnt = run.rates["exponent"][_MEASURED:]
    assert before * 0.9 < learnt[0] <= before * 1.1 and learnt[-1] < 0.02e-3
    assert math.isclose(run.train(2), 5.0, abs_tol=2.0)
    assert not run.rates


def test_too_few_minutes_are_refused_and_leave_nothing(run):
    with pytest.raises(
        ValueError, match=r"--minutes 0\.2 is too short .*at least 0\.\d are needed"
    ):
        run.train(0.2)
    assert not config_path(run.out).exists()
    with pytest.raises(ValueError, match="of 1 of 2 stages"):
        run.train(0.01)
    assert run.train(1) <= 60


def test_a_killed_run_leaves_the_weights_so_far(run, monkeypatch):
    monkeypatch.setattr(trainer, "_SECONDS_BETWEEN_MODELS", 10)

    def interrupt(progress):
        if progress.stage.name == "exponent" and progress.step == 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.train(2, interrupt)
    _, found = weights.load(run.out, whole=False)
    assert set(found) == {"albedo", "exponent"}
    assert (run.out / "model" / "training.json").is_file()


def test_a_run_within_minutes_takes_over_no_stage(run):
    with pytest.raises(ValueError, match="leave out --minutes"):
        run.train(1, reuse=run.bank)
