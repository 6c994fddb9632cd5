"""All stages of a run, one after another, each resumable.

`RUN/config.json` says what the run is; `RUN/stages/N-name.npz` holds a stage's weights, optimiser
state and step; `RUN/curves/N-name.csv` its losses; `RUN/model/` the trained model.
"""

import csv
import dataclasses
import hashlib
import importlib.metadata
import json
import math
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import keras
import numpy as np

from lime_keras import corpus as corpus_files
from lime_keras import pipeline, weights
from lime_keras.networks import Architecture, build
from lime_keras.version import __version__

from .stage_model import StageModel
from .stages import Schedule, Stage

_SECONDS_BETWEEN_CHECKPOINTS = 60
_CURVE_POINTS, _LONGEST_INTERVAL = 10, 500
"""How often the held-out losses are taken: so many times a stage, or every so many batches."""
_FEATURES_USED = (
    "image",
    "mask",
    "diffuse_shading",
    "specular_shading",
    "mirror",
    "diffuse_albedo",
    "specular_albedo",
    "ambient",
    "exponent_bin",
)
_PACKAGES = ("tensorflow", "keras", "numpy")

Tell = Callable[[Stage, int, dict[str, float]], None]


@dataclasses.dataclass(frozen=True)
class Config:
    """Everything that a run's weights depend on, apart from the software.

    Attributes:
        preset: name of the architecture and schedule.
        architecture: of the subnetworks.
        schedule: of the stages.
        seed: of initialisation and order; 0 is a seed.
        corpus_sha256: of the train split's manifest.
    """

    preset: str
    architecture: Architecture
    schedule: Schedule
    seed: int
    corpus_sha256: str


def corpus_sha256(corpus: Path) -> str:
    """What identifies the train split of a corpus: its shards' checksums, hashed."""
    digests = corpus_files.read_manifest(corpus, "train")["sha256"]
    return hashlib.sha256("".join(digests).encode()).hexdigest()


def train(corpus: Path, run: Path, config: Config, tell: Tell) -> None:
    """Run or resume all stages.

    Args:
        corpus: folder with a complete train split.
        run: folder of the run; one that was begun with the same config is carried on.
        config: of the run.
        tell: called with (stage, steps done, losses of the last interval) as training goes on.

    Raises:
        FileNotFoundError: if the corpus is incomplete.
        ValueError: if the folder holds a run of another config, or the corpus is too small.
        RuntimeError: if a loss is not finite.
    """
    training_shards, validation_shards = pipeline.training_shards(corpus)
    _claim(run, config)
    keras.utils.set_random_seed(config.seed)
    subnetworks = build(config.architecture)
    validation = pipeline.evaluation(
        validation_shards, size=config.architecture.size, batch_size=config.schedule.batch_size
    )
    validation = validation.take(
        math.ceil(config.schedule.validation_examples / config.schedule.batch_size)
    )
    validation = validation.map(_used).cache()
    for number, stage in enumerate(config.schedule.stages(), 1):

        def batches(first_step: int, number: int = number):
            dataset = pipeline.training(
                training_shards,
                size=config.architecture.size,
                batch_size=config.schedule.batch_size,
                seed=config.seed * 100 + number,
                first_step=first_step,
            )
            return dataset.map(_used)

        _train_stage(run, number, stage, subnetworks, batches, validation, tell)
    weights.save(run / "model", config.architecture, subnetworks)


def _used(example: dict) -> dict:
    """Only what the losses read, so that no backend is fed strings or normals."""
    return {name: example[name] for name in _FEATURES_USED}


def _train_stage(
    run: Path,
    number: int,
    stage: Stage,
    subnetworks: dict[str, keras.Model],
    batches: Callable,
    validation,
    tell: Tell,
) -> None:
    """Train one stage from its checkpoint, or take its weights if it is done."""
    model = StageModel({name: subnetworks[name] for name in stage.subnetworks})
    model.compile(optimizer=keras.optimizers.Adam(stage.learning_rate))
    checkpoint = _Checkpoint(run / "stages" / f"{number}-{stage.name}.npz", model)
    step = checkpoint.restore()
    tell(stage, step, {})
    if step == stage.steps:
        return
    curve = _Curve(run / "curves" / f"{number}-{stage.name}.csv", step)
    interval = min(max(1, stage.steps // _CURVE_POINTS), _LONGEST_INTERVAL)
    if step == 0:
        curve.add(0, {}, _validate(model, validation))
    model.reset_metrics()
    iterator = iter(batches(step))
    saved = time.monotonic()
    while step < stage.steps:
        # The running means since the last reset, not the last batch's.
        logs = model.train_on_batch(next(iterator), return_dict=True)
        step += 1
        _refuse_non_finite(stage, step, logs)
        tell(stage, step, logs)
        if step % interval == 0 or step == stage.steps:
            curve.add(step, logs, _validate(model, validation))
            model.reset_metrics()
        if step == stage.steps or time.monotonic() - saved > _SECONDS_BETWEEN_CHECKPOINTS:
            checkpoint.save(step)
            saved = time.monotonic()


def _validate(model: StageModel, validation) -> dict[str, float]:
    """Mean losses over the held-out batches."""
    model.reset_metrics()
    for batch in validation:
        logs = model.test_on_batch(batch, return_dict=True)
    return logs


def _refuse_non_finite(stage: Stage, step: int, logs: dict[str, float]) -> None:
    """Stop at the first loss that is not a number."""
    broken = [name for name, value in logs.items() if not math.isfinite(value)]
    if broken:
        raise RuntimeError(
            f"stage {stage.name}, step {step}: {', '.join(broken)} not finite; the run's last "
            "checkpoint is from before. Lower the learning rate, or check the corpus"
        )


class _Checkpoint:
    """A stage's weights, optimiser state and step in one file, replaced atomically."""

    def __init__(self, path: Path, model: StageModel):
        self._path = path
        model.optimizer.build(model.trainable_variables)
        self._variables = [*model.weights, *model.optimizer.variables]

    def save(self, step: int) -> None:
        """Write the state after `step` batches."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        values = [keras.ops.convert_to_numpy(variable) for variable in self._variables]
        partial = self._path.with_name(f"partial-{self._path.name}")
        np.savez(partial, *values, step=step)
        os.replace(partial, self._path)

    def restore(self) -> int:
        """Load the state if there is one; the number of batches it has seen."""
        if not self._path.is_file():
            return 0
        with np.load(self._path) as stored:
            for index, variable in enumerate(self._variables):
                variable.assign(stored[f"arr_{index}"])
            return int(stored["step"])


class _Curve:
    """Losses by step in a CSV file; rows from after the restored step are dropped."""

    def __init__(self, path: Path, step: int):
        self._path = path
        self._began = time.monotonic()
        self._rows: list[dict[str, object]] = []
        if path.is_file():
            with path.open(newline="", encoding="utf-8") as file:
                rows = [dict(row) for row in csv.DictReader(file)]
            self._rows = [row for row in rows if step > 0 and int(row["step"]) <= step]
        self._earlier = float(self._rows[-1]["seconds"]) if self._rows else 0.0

    def add(self, step: int, training: dict[str, float], validation: dict[str, float]) -> None:
        """Append a row and write the file."""
        seconds = self._earlier + time.monotonic() - self._began
        row: dict[str, object] = {"step": step, "seconds": f"{seconds:.1f}"}
        row |= {f"train_{name}": f"{value:.6g}" for name, value in training.items()}
        row |= {f"validation_{name}": f"{value:.6g}" for name, value in validation.items()}
        self._rows.append(row)
        self._path.parent.mkdir(parents=True, exist_ok=True)
        columns = dict.fromkeys(name for one in self._rows for name in one)
        partial = self._path.with_name(f"partial-{self._path.name}")
        with partial.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(columns))
            writer.writeheader()
            writer.writerows(self._rows)
        os.replace(partial, self._path)


def _claim(run: Path, config: Config) -> None:
    """Record what the run is; refuse a folder that holds another run."""
    path = run / "config.json"
    wanted = json.loads(json.dumps(dataclasses.asdict(config)))
    if path.is_file():
        held = json.loads(path.read_text(encoding="utf-8"))["config"]
        differing = [
            f"{key} {held.get(key)} there, {wanted.get(key)} asked"
            for key in sorted(wanted | held)
            if wanted.get(key) != held.get(key)
        ]
        if differing:
            raise ValueError(
                f"{run} holds another run: {'; '.join(differing)}. Pass another --out, the same "
                "options and corpus, or remove it"
            )
        return
    record = {
        "config": wanted,
        "version": __version__,
        "backend": keras.backend.backend(),
        "packages": {name: importlib.metadata.version(name) for name in _PACKAGES},
        "commit": _commit(),
    }
    run.mkdir(parents=True, exist_ok=True)
    partial = run / "partial-config.json"
    partial.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    os.replace(partial, path)


def _commit() -> str | None:
    """Git commit of the code that trains, None outside a checkout."""
    try:
        answer = subprocess.run(
            ["git", "rev-parse", "HEAD"],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return answer.stdout.strip()
