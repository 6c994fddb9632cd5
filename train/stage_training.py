"""The training of one stage: steps, checkpoints, curves, and a stop if a loss is not finite."""

import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping
from time import monotonic
from typing import NoReturn

from lime_keras.networks.wiring import Networks

from .data import Batch, Data, without_origin
from .devices import Devices
from .optimizer import gradient_norms
from .stage_model import StageModel
from .stages import Stage
from .state import Checkpoint, Curve, means
from .tensorboard_log import Board

_SECONDS_BETWEEN_CHECKPOINTS = 60
_CURVE_POINTS, _LONGEST_INTERVAL = 10, 500
"""Number of evaluations on the validation set in a stage, and most batches between two of them."""


@dataclasses.dataclass(frozen=True)
class Progress:
    """The progress of a stage in training.

    Attributes:
        stage: the stage.
        step: number of batches done.
        losses: mean training losses by name, since the last evaluation on the validation set.
        data_wait: share of the time since that evaluation spent waiting for batches, in [0, 1].
    """

    stage: Stage
    step: int
    losses: Mapping[str, float]
    data_wait: float


Tell = Callable[[Progress], None]


@dataclasses.dataclass(frozen=True)
class StageRun:
    """A stage to load or to train.

    Attributes:
        stage: the stage.
        model: its model, compiled with its optimiser before it is trained.
        kept: frozen subnetworks whose predictions are kept with the photos.
        checkpoint: checkpoint of the stage; its file may not exist yet.
        step: number of batches at which the checkpoint stood when the run was opened.
    """

    stage: Stage
    model: StageModel
    kept: Networks
    checkpoint: Checkpoint
    step: int

    @property
    def is_finished(self) -> bool:
        """Whether the checkpoint is that of the last batch."""
        return self.step == self.stage.steps


class StageTraining:
    """The training of a stage, from its checkpoint or from its start to its last batch.

    The progress is reported before the first batch, and after each.
    """

    def __init__(self, part: StageRun, data: Data, devices: Devices, tell: Tell):
        self._part, self._data, self._devices, self._tell = part, data, devices, tell
        self._features = data.with_input_mask(part.stage, part.model.features)

    def run(self) -> None:
        """Train until the stage's last batch.

        Raises:
            RuntimeError: if a loss or a gradient is not finite. The message names the example if
                a single one causes it.
            ValueError: if a record is damaged.
        """
        part = self._part
        if part.step:
            part.checkpoint.restore(part.model)
        board_path = part.checkpoint.board_path if self._devices.leads else None
        with contextlib.closing(Board(board_path)) as board:
            self._run(Curve(part.checkpoint.curve_path, part.step), board)

    def _run(self, curve: Curve, board: Board) -> None:
        # Begin: the validation set is looked at before the first batch.
        stage, model, step = self._part.stage, self._part.model, self._part.step
        interval = min(max(1, stage.steps // _CURVE_POINTS), _LONGEST_INTERVAL)
        self._tell(Progress(stage, step, {}, 0.0))
        if step == 0:
            self._validate(0, {}, curve, board)
        batches = self._data.training(stage, self._features, step, self._part.kept)
        losses: list[dict[str, float]] = []
        norms: list[dict[str, float]] = []
        waited, began = 0.0, monotonic()
        saved, first = began, step
        while step < stage.steps:
            # Learn from a batch.
            asked = monotonic()
            batch = next(batches)
            waited += monotonic() - asked
            batch_losses = self._step(batch)
            step += 1
            batch_norms = gradient_norms(model.optimizer)
            if not _finite(batch_losses) or not _finite(batch_norms):
                self._stop(step, batch, batch_losses, batch_norms)
            # Tell, and look at the validation set.
            losses.append(batch_losses)
            norms.append(batch_norms)
            if step == stage.steps:
                model.optimizer.finalize_variable_values(model.trainable_variables)
            elapsed = monotonic() - began
            self._tell(Progress(stage, step, means(losses), waited / max(elapsed, 1e-9)))
            if step % interval == 0 or step == stage.steps:
                rates = {"steps a second": (step - first) / elapsed, "data wait": waited / elapsed}
                self._validate(step, means(losses), curve, board)
                board.scalars(step, {"gradient norm": means(norms), "throughput": rates})
                losses, norms, waited, began, first = [], [], 0.0, monotonic(), step
            # Keep.
            if step == stage.steps or monotonic() - saved > _SECONDS_BETWEEN_CHECKPOINTS:
                if self._devices.leads:
                    self._part.checkpoint.save(model, step)
                saved = monotonic()

    def _step(self, batch: Batch) -> dict[str, float]:
        """Take a training step and return the batch's losses by name."""
        shares = self._devices.split(without_origin(batch))
        return self._part.model.train_on_batch(shares, return_dict=True)

    def _validate(self, step: int, training: dict[str, float], curve: Curve, board: Board) -> None:
        """Evaluate on the validation set and record its losses with the training losses."""
        batches = self._data.validation(self._features, self._part.kept)
        validation, measured, _ = evaluate(self._part.model, batches, self._devices)
        groups = {"training": training, "validation": validation, "measure": measured}
        if self._devices.leads:
            curve.add(step, groups)
        board.scalars(step, groups)

    def _stop(
        self, step: int, batch: Batch, losses: Mapping[str, float], norms: Mapping[str, float]
    ) -> NoReturn:
        """Find the examples that cause a non-finite value, by a step on each one alone.

        The steps are safe: the optimiser ignores a gradient that is not finite (`WatchedAdam`).
        """
        broken = [name for name, value in losses.items() if not math.isfinite(value)]
        broken += [
            f"the gradient of {name}" for name, value in norms.items() if not math.isfinite(value)
        ]
        blamed = []
        for row in range(len(batch["mask"])):
            alone = self._step({name: value[row : row + 1] for name, value in batch.items()})
            if not _finite(alone) or not _finite(gradient_norms(self._part.model.optimizer)):
                named = f"example {int(batch['index'][row])} of seed {int(batch['seed'][row])}"
                blamed.append(named)
        cause = (
            f"from {', '.join(blamed)} of the train split: render it again, or leave it out"
            if blamed
            else "no example of the batch does it alone: try another --seed or --precision float32"
        )
        raise RuntimeError(
            f"stage {self._part.stage.name}, step {step}: {', '.join(broken)} not finite; {cause}. "
            "The run's last checkpoint is from before"
        )


def evaluate(
    model: StageModel, batches: Iterable[Batch], devices: Devices
) -> tuple[dict[str, float], dict[str, float], int]:
    """Return mean losses and measures of a compiled model by name, and the number of examples."""
    losses: list[dict[str, float]] = []
    examples = 0
    model.reset_measures()
    for batch in batches:
        examples += len(batch["mask"])
        shares, weights = devices.split(batch), devices.weights(batch)
        loss = model.test_on_batch(shares, sample_weight=weights, return_dict=True)
        losses += [loss] * len(batch["mask"])  # the last batch may be smaller
    return means(losses), model.measured() if examples else {}, examples


def _finite(values: Mapping[str, float]) -> bool:
    return all(math.isfinite(value) for value in values.values())
