"""The training of one stage: steps, checkpoints, curves, and a stop if a loss is not finite."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import NoReturn

from .budget import Cost, seconds_of, seconds_of_evaluation
from .data import Batch, Data, without_origin
from .devices import Devices
from .optimizer import gradient_norms
from .pace import Pace
from .stage_model import StageModel
from .stages import Stage
from .state import Checkpoint, Curve, Means, Position, restore, values
from .tensorboard_log import Board

_SECONDS_BETWEEN_CHECKPOINTS = 60
_TIMED_STEPS = 3
"""Number of batches whose mean time is taken for that of a stage's batches."""


@dataclasses.dataclass(frozen=True)
class Progress:
    """The progress of a stage in training.

    Attributes:
        stage: the stage.
        step: number of batches done.
        losses: mean training losses by name, since the last evaluation on held-out examples.
        data_wait: share of the time since that evaluation spent waiting for batches, in [0, 1].
        done: share of the stage that is done, in [0, 1].
        left: seconds left of the run's budget; None if the stage has a number of batches.
        compiled: number of stages that are compiled and measured, and number of those to train,
            before a run with a budget begins to train; None in training.
    """

    stage: Stage
    step: int
    losses: Mapping[str, float]
    data_wait: float
    done: float = 1.0
    left: float | None = None
    compiled: tuple[int, int] | None = None


Tell = Callable[[Progress], None]


class Files:
    """The paths of a stage's state and logs in the folder of its run.

    Args:
        run: folder of the run.
        name: number and name of the stage, such as `1-segmentation`.
    """

    def __init__(self, run: Path, name: str):
        self.checkpoint = run / "stages" / f"{name}.npz"
        self.curve = run / "curves" / f"{name}.csv"
        self.board = run / "tensorboard" / name


class StageTraining:
    """The training of a stage, from its checkpoint or from its start to its last batch.

    Args:
        stage: stage to train.
        model: model of the stage, compiled with its optimiser.
        checkpoint: checkpoint of the stage; its file may not exist yet.
        files: paths of the stage's files.
        data: training and held-out examples.
        devices: devices that each batch is split between.
        tell: function called with the progress after each batch, and once before.
    """

    def __init__(
        self,
        stage: Stage,
        model: StageModel,
        checkpoint: Checkpoint,
        files: Files,
        data: Data,
        devices: Devices,
        tell: Tell,
    ):
        self._stage, self._model, self._checkpoint, self._files = stage, model, checkpoint, files
        self._data, self._devices, self._tell = data, devices, tell
        self._features = data.seen(stage, model.features)

    def measure(self) -> Cost:
        """Compile the functions of the stage, measure their time, and leave the model as it was."""
        model, before = self._model, values(self._model)
        batches = self._data.training(self._stage, self._features, 0)

        def step() -> None:
            self._step(next(batches))

        step()
        seconds = sum(seconds_of(step) for _ in range(_TIMED_STEPS)) / _TIMED_STEPS
        restore(model, before)
        look = seconds_of_evaluation(self._data.held_out(self._features), self._evaluate)
        return Cost(seconds, look)

    def run(self, pace: Pace, keep: Callable[[], None]) -> None:
        """Train until the stage's last batch.

        Args:
            pace: pace of the stage.
            keep: function called after each batch, which may write the model trained so far.

        Raises:
            RuntimeError: if a loss or a gradient is not finite. The message names the example if
                a single one causes it.
            ValueError: if a record is damaged.
        """
        position = self._checkpoint.position()
        step = 0 if position is None else position.step
        if step:
            self._checkpoint.restore(self._model)
        curve = Curve(self._files.curve, step)
        board = Board(self._files.board if self._devices.leads else None)
        try:
            self._run(step, pace, keep, curve, board)
        finally:
            board.close()

    def _run(
        self, step: int, pace: Pace, keep: Callable[[], None], curve: Curve, board: Board
    ) -> None:
        # Begin: what is held out is looked at before the first batch.
        stage, model = self._stage, self._model
        self._tell(Progress(stage, step, {}, 0.0, pace.progress(step), pace.left))
        if step == 0:
            pace.looked(0.0, self._evaluate_held_out(0, {}, curve, board))
        batches = self._data.training(stage, self._features, step)
        losses, norms, waited, began = Means(), Means(), 0.0, monotonic()
        saved, first = began, step
        pace.start()
        progress = pace.progress(step)
        while True:
            # Learn from a batch; however short its time is, from the first one of a stage.
            now = progress if step else 0.0
            rate = pace.rate(now, stage.learning_rate * stage.risen(now))
            if rate is not None:
                model.optimizer.learning_rate = rate
            asked = monotonic()
            batch = next(batches)
            waited += monotonic() - asked
            batch_losses = self._step(batch)
            step += 1
            batch_norms = gradient_norms(model.optimizer)
            if not _finite(batch_losses) or not _finite(batch_norms):
                self._stop(step, batch, batch_losses, batch_norms)
            # Tell, and look at what is held out.
            losses.add(batch_losses)
            norms.add(batch_norms)
            progress = pace.progress(step)
            elapsed = monotonic() - began
            share = waited / max(elapsed, 1e-9)
            self._tell(Progress(stage, step, losses.means(), share, progress, pace.left))
            if pace.looks(step, progress):
                rates = {"steps a second": (step - first) / elapsed, "data wait": waited / elapsed}
                pace.looked(progress, self._evaluate_held_out(step, losses.means(), curve, board))
                board.scalars(step, {"gradient norm": norms.means(), "throughput": rates})
                losses, norms, waited, began, first = Means(), Means(), 0.0, monotonic(), step
            # Keep.
            if progress >= 1 or monotonic() - saved > _SECONDS_BETWEEN_CHECKPOINTS:
                if self._devices.leads:
                    self._checkpoint.save(model, Position(step, **pace.state(progress)))
                saved = monotonic()
            if progress >= 1:
                return
            keep()

    def _step(self, batch: Batch) -> dict[str, float]:
        """Take a training step and return the batch's losses by name."""
        seen = self._devices.split(without_origin(batch))
        return self._model.train_on_batch(seen, return_dict=True)

    def _evaluate(self, batch: Batch) -> dict[str, float]:
        """Update the measures with a held-out batch and return the batch's losses by name."""
        devices = self._devices
        seen, weights = devices.split(devices.part(batch)), devices.weights(batch)
        return self._model.test_on_batch(seen, sample_weight=weights, return_dict=True)

    def _evaluate_held_out(
        self, step: int, training: dict[str, float], curve: Curve, board: Board
    ) -> float:
        """Evaluate on the held-out examples and record their losses with the training losses.

        Returns:
            The seconds that it took.
        """
        began, model, losses = monotonic(), self._model, Means()
        model.reset_measures()
        for batch in self._data.held_out(self._features):
            losses.add(self._evaluate(batch))
        held_out = losses.means()
        measured = model.measured() if held_out else {}
        if self._devices.leads:
            curve.add(step, training, held_out, measured)
        board.scalars(step, {"training": training, "held out": held_out, "measure": measured})
        return monotonic() - began

    def _stop(
        self, step: int, batch: Batch, losses: Mapping[str, float], norms: Mapping[str, float]
    ) -> NoReturn:
        """Find the examples that cause a non-finite value, by a step on each one alone.

        The steps are safe: the optimiser ignores a gradient that is not finite (`WatchedAdam`).

        Raises:
            RuntimeError: always; the message names the examples.
        """
        broken = [name for name, value in losses.items() if not math.isfinite(value)]
        broken += [
            f"the gradient of {name}" for name, value in norms.items() if not math.isfinite(value)
        ]
        blamed = []
        for row in range(len(batch["mask"])):
            alone = self._step({name: value[row : row + 1] for name, value in batch.items()})
            if not _finite(alone) or not _finite(gradient_norms(self._model.optimizer)):
                blamed.append(row)
        found = (
            f"from {self._data.blamed(step - 1, batch, blamed)}{self._shared()}"
            if blamed
            else "no example of the batch does it alone: try another --seed or --precision float32"
        )
        raise RuntimeError(
            f"stage {self._stage.name}, step {step}: {', '.join(broken)} not finite; {found}. The "
            "run's last checkpoint is from before"
        )

    def _shared(self) -> str:
        """Return what to say of an example if other processes took a step with one of theirs."""
        others = self._devices.processes - 1
        return f", or from what the {others} other --hosts name" if others else ""


def _finite(values: Mapping[str, float]) -> bool:
    return all(math.isfinite(value) for value in values.values())
