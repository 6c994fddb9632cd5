"""What a stage leaves on disk as it goes: checkpoints and loss curves, replaced atomically."""

import csv
import time
import zipfile
from collections.abc import Mapping
from pathlib import Path

import keras
import numpy as np

from lime_keras.io import atomic

from .stage_model import StageModel


class Checkpoint:
    """A stage's weights, optimiser state and step in one file, replaced atomically.

    Args:
        path: of the file, `.npz`.
        signature: what the stage's weights follow from; a file of another one is refused.
    """

    def __init__(self, path: Path, signature: str):
        self.path = path
        self._signature = signature

    def step(self, refuse: bool = True) -> int | None:
        """Batches that the file's state has seen; None if there is no file.

        Args:
            refuse: another signature's file; else it counts as none.

        Raises:
            ValueError: if the file is broken, or refused.
        """
        if not self.path.is_file():
            return None
        try:
            with np.load(self.path) as stored:
                signature, step = str(stored["signature"]), int(stored["step"])
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
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
        return step

    def save(self, model: StageModel, step: int) -> None:
        """Write the state after `step` batches."""
        values = [keras.ops.convert_to_numpy(variable) for variable in _variables(model)]
        with atomic.replacing(self.path) as partial:
            np.savez(partial, *values, step=step, signature=self._signature)

    def restore(self, model: StageModel) -> None:
        """Load the state, or, into a model that is not compiled, the weights; there must be one."""
        with np.load(self.path) as stored:
            for index, variable in enumerate(_variables(model)):
                variable.assign(stored[f"arr_{index}"])


def _variables(model: StageModel) -> list[keras.Variable]:
    """All that decides how a stage goes on; metrics start anew with each batch."""
    weights = [variable for network in model.subnetworks.values() for variable in network.weights]
    return [*weights, *(model.optimizer.variables if model.compiled else [])]


class Means:
    """Running means of several batches' numbers; Keras' `train_on_batch` tells the last batch's."""

    def __init__(self):
        self._sums: dict[str, float] = {}
        self._count = 0

    def add(self, values: Mapping[str, float]) -> None:
        """Take in one batch."""
        self._count += 1
        for name, value in values.items():
            self._sums[name] = self._sums.get(name, 0.0) + float(value)

    def means(self) -> dict[str, float]:
        """Mean of each number over the batches so far."""
        return {name: total / self._count for name, total in self._sums.items()}


class Curve:
    """Losses and measures by step in a CSV file; rows from after the restored step are dropped."""

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
            step: batches done.
            training: mean losses of the interval before it.
            validation: mean losses of the held-out examples.
            measures: of the held-out examples; errors and shares, on scales of their own.
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
