"""All stages of a run, one after another, each resumable.

`RUN/config.json` says what the run is; `RUN/stages/N-name.npz` holds a stage's weights, optimiser
state and step; `RUN/curves/N-name.csv` its losses; `RUN/model/` the trained model.
"""

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import keras

from lime_keras import corpus as corpus_files
from lime_keras import pipeline, weights
from lime_keras.networks import build

from .config import Config, claim
from .stage_model import StageModel
from .stages import Stage
from .state import Checkpoint, Curve, MeanLosses

_SECONDS_BETWEEN_CHECKPOINTS = 60
_CURVE_POINTS, _LONGEST_INTERVAL = 10, 500
"""How often the held-out losses are taken: so many times a stage, or every so many batches."""

Tell = Callable[[Stage, int, dict[str, float]], None]


def train(corpus: Path, run: Path, config: Config, tell: Tell) -> None:
    """Run or resume all stages.

    Args:
        corpus: folder with a complete train split.
        run: folder of the run; one that was begun with the same config is carried on.
        config: of the run.
        tell: called with (stage, steps done, losses of the last interval) as training goes on.

    Raises:
        FileNotFoundError: if the corpus is incomplete.
        ValueError: if the folder holds a run of another config, or the corpus is too small or
            damaged.
        RuntimeError: if a loss is not finite.
    """
    training_shards, validation_shards = pipeline.training_shards(corpus)
    _check_size(corpus, config.architecture.size)
    claim(run, config)
    keras.utils.set_random_seed(config.seed)
    subnetworks = build(config.architecture)
    held_out = pipeline.evaluation(
        validation_shards,
        size=config.architecture.size,
        batch_size=config.schedule.batch_size,
        camera=config.camera,
        features=pipeline.LEARNT_FROM,
    )
    held_out = held_out.take(
        math.ceil(config.schedule.validation_examples / config.schedule.batch_size)
    ).cache()

    def validation() -> Iterator:
        return pipeline.naming_damage(held_out, validation_shards)

    for number, stage in enumerate(config.schedule.stages(), 1):

        def batches(first_step: int, number: int = number) -> Iterator:
            dataset = pipeline.training(
                training_shards,
                size=config.architecture.size,
                batch_size=config.schedule.batch_size,
                seed=config.seed * 100 + number,
                first_step=first_step,
                camera=config.camera,
            )
            return pipeline.naming_damage(dataset, training_shards)

        _train_stage(run, number, stage, subnetworks, batches, validation, tell)
    weights.save(run / "model", config.architecture, subnetworks)


def _check_size(corpus: Path, size: int) -> None:
    """Refuse images that cannot be averaged to the networks' size."""
    stored = corpus_files.read_manifest(corpus, "train").get("description", {}).get("size", size)
    if stored % size:
        raise ValueError(
            f"{corpus} holds images of {stored} pixels, which cannot be averaged to the {size} "
            f"that this preset takes: render with --size {size} or a multiple of it"
        )


def _train_stage(
    run: Path,
    number: int,
    stage: Stage,
    subnetworks: dict[str, keras.Model],
    batches: Callable[[int], Iterator],
    validation: Callable[[], Iterator],
    tell: Tell,
) -> None:
    """Train one stage from its checkpoint, or take its weights if it is done."""
    model = StageModel({name: subnetworks[name] for name in stage.subnetworks})
    model.compile(optimizer=keras.optimizers.Adam(stage.learning_rate))
    checkpoint = Checkpoint(run / "stages" / f"{number}-{stage.name}.npz", model)
    step = checkpoint.restore()
    tell(stage, step, {})
    if step == stage.steps:
        return
    curve = Curve(run / "curves" / f"{number}-{stage.name}.csv", step)
    interval = min(max(1, stage.steps // _CURVE_POINTS), _LONGEST_INTERVAL)
    if step == 0:
        curve.add(0, {}, _validate(model, validation()))
    iterator, interval_losses = batches(step), MeanLosses()
    saved = time.monotonic()
    while step < stage.steps:
        losses = model.train_on_batch(next(iterator), return_dict=True)
        step += 1
        _refuse_non_finite(stage, step, losses)
        interval_losses.add(losses)
        tell(stage, step, interval_losses.means())
        if step % interval == 0 or step == stage.steps:
            curve.add(step, interval_losses.means(), _validate(model, validation()))
            interval_losses = MeanLosses()
        if step == stage.steps or time.monotonic() - saved > _SECONDS_BETWEEN_CHECKPOINTS:
            checkpoint.save(step)
            saved = time.monotonic()


def _validate(model: StageModel, batches: Iterator) -> dict[str, float]:
    """Mean losses over the held-out batches."""
    losses = MeanLosses()
    for batch in batches:
        losses.add(model.test_on_batch(batch, return_dict=True))
    return losses.means()


def _refuse_non_finite(stage: Stage, step: int, logs: dict[str, float]) -> None:
    """Stop at the first loss that is not a number."""
    broken = [name for name, value in logs.items() if not math.isfinite(value)]
    if broken:
        raise RuntimeError(
            f"stage {stage.name}, step {step}: {', '.join(broken)} not finite; the run's last "
            "checkpoint is from before. Check the corpus for broken examples, or try another --seed"
        )
