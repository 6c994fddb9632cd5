"""The files that a stage writes during training: its checkpoint and its loss curves."""

import csv
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import keras
import numpy as np

from lime_keras.io import atomic

from .stage_model import StageModel


class Position(NamedTuple):
    """The point of a stage at which a checkpoint was written.

    Attributes:
        step: number of batches done.
        progress: share of the stage's time that was over, in [0, 1]; None if the stage has a number
            of batches.
        spent: seconds that the whole run had taken; 0 if the stage has a number of batches.
    """

    step: int
    progress: float | None = None
    spent: float = 0.0


class Checkpoint:
    """A checkpoint of a stage: weights, optimiser state and step in one file, replaced atomically.

    Args:
        path: path of the file, `.npz`.
        signature: hash of everything that the stage's weights follow from. A file with another
            signature is refused.
    """

    def __init__(self, path: Path, signature: str):
        self.path = path
        self._signature = signature

    def position(self, refuse: bool = True) -> Position | None:
        """Return the point at which the checkpoint was written; None if there is no file.

        Args:
            refuse: whether to raise an error for a file with another signature. If False, such a
                file is treated as missing.

        Raises:
            ValueError: if the file is broken or refused.
        """
        if not self.path.is_file():
            return None
        try:
            with np.load(self.path) as stored:
                signature, position = str(stored["signature"]), Position(int(stored["step"]))
                if "progress" in stored:
                    progress, spent = float(stored["progress"]), float(stored["spent"])
                    position = Position(position.step, progress, spent)
        except Exception as error:  # NumPy and zipfile raise whatever a byte leads them to
            raise ValueError(
                f"{self.path} cannot be read: {error}; delete it to train the stage again"
            ) from error
        if signature != self._signature and not refuse:
            return None
        if signature != self._signature:
            raise ValueError(
                f"{self.path} was trained from other weights than an earlier stage now has: delete "
                "it to train the stage again"
            )
        return position

    def save(self, model: StageModel, position: Position) -> None:
        """Write the state of a model at a point of its stage."""
        point = position._asdict() if position.progress is not None else {"step": position.step}
        with atomic.replacing(self.path) as partial:
            np.savez(partial, *values(model), signature=self._signature, **point)

    def restore(self, model: StageModel) -> None:
        """Load the state into a model, or only the weights if it is not compiled.

        The file must exist.
        """
        with np.load(self.path) as stored:
            restore(model, [stored[f"arr_{index}"] for index in range(len(_variables(model)))])


def values(model: StageModel) -> list[np.ndarray]:
    """Return copies of all values that later steps depend on: metrics are not among them."""
    return [np.array(keras.ops.convert_to_numpy(variable)) for variable in _variables(model)]


def restore(model: StageModel, saved: Sequence[np.ndarray]) -> None:
    """Set the values of a model to those that `values` returned."""
    for variable, value in zip(_variables(model), saved, strict=True):
        variable.assign(value)


def _variables(model: StageModel) -> list[keras.Variable]:
    weights = [variable for network in model.subnetworks.values() for variable in network.weights]
    return [*weights, *(model.optimizer.variables if model.compiled else [])]


class Means:
    """Running means over several batches; Keras' `train_on_batch` returns one batch's losses."""

    def __init__(self):
        self._sums: dict[str, float] = {}
        self._count = 0

    def add(self, values: Mapping[str, float]) -> None:
        """Add the numbers of one batch."""
        self._count += 1
        for name, value in values.items():
            self._sums[name] = self._sums.get(name, 0.0) + float(value)

    def means(self) -> dict[str, float]:
        """Return the mean of each number over the batches so far."""
        return {name: total / self._count for name, total in self._sums.items()}


class Curve:
    """A CSV file of losses and measures by step.

    Args:
        path: path of the file, which may exist.
        step: step from which training goes on; rows of later steps are dropped.
    """

    def __init__(self, path: Path, step: int):
        self._path = path
        self._began = time.monotonic()
        self._rows: list[dict[str, str]] = []
        if path.is_file():
            with path.open(newline="", encoding="utf-8") as file:
                rows = [dict(row) for row in csv.DictReader(file)]
            self._rows = [row for row in rows if step > 0 and int(row["step"]) <= step]
        self._earlier = float(self._rows[-1]["seconds"]) if self._rows else 0.0

    def add(
        self,
        step: int,
        training: Mapping[str, float],
        validation: Mapping[str, float],
        measures: Mapping[str, float],
    ) -> None:
        """Append a row and write the file.

        Args:
            step: number of batches done.
            training: mean training losses since the row before.
            validation: mean losses of the held-out examples.
            measures: measures of the held-out examples, which are errors or shares.
        """
        seconds = self._earlier + time.monotonic() - self._began
        row = {"step": str(step), "seconds": f"{seconds:.1f}"}
        groups = {"train": training, "validation": validation, "measure": measures}
        for group, values in groups.items():
            row |= {f"{group}_{name}": f"{value:.6g}" for name, value in values.items()}
        self._rows.append(row)
        columns = dict.fromkeys(name for one in self._rows for name in one)
        with (
            atomic.replacing(self._path) as partial,
            partial.open("w", newline="", encoding="utf-8") as file,
        ):
            writer = csv.DictWriter(file, list(columns))
            writer.writeheader()
            writer.writerows(self._rows)
