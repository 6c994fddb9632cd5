"""The files that a stage writes during training: its checkpoint and its loss curves."""

import csv
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import keras
import numpy as np

from lime_keras.io import atomic, untrusted

from .stage_model import StageModel


class Checkpoint:
    """A checkpoint of a stage: weights, optimiser state and step in one file, replaced atomically.

    Args:
        run: folder of the run.
        name: number and name of the stage, such as `1-segmentation`.
        signature: hash of everything that the stage's weights follow from. A file with another
            signature is refused.
    """

    def __init__(self, run: Path, name: str, signature: str):
        self.path = run / "stages" / f"{name}.npz"
        self.curve_path = run / "curves" / f"{name}.csv"
        self.board_path = run / "tensorboard" / name
        self._signature = signature

    def step(self, refuse: bool = True) -> int | None:
        """Return the number of batches done when it was written; None if there is no file.

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
                signature, step = str(stored["signature"]), int(stored["step"])
        except Exception as error:  # NumPy and zipfile raise whatever a byte leads them to
            raise ValueError(
                f"{self.path} cannot be read: {error}; delete it to train the stage again"
            ) from error
        if signature != self._signature and not refuse:
            return None
        if signature != self._signature:
            raise ValueError(
                f"{self.path} was trained from other weights of an earlier stage, or with other "
                "losses or options, than this run has now: delete it to train the stage again"
            )
        return step

    def save(self, model: StageModel, step: int) -> None:
        """Write the state of a model after a number of batches."""
        values = [keras.ops.convert_to_numpy(variable) for variable in _variables(model)]
        with atomic.replacing(self.path) as partial:
            np.savez(partial, *values, signature=self._signature, step=step)
            with partial.open("r+b") as file:
                os.fsync(file.fileno())  # or lost power takes the one before, too

    def restore(self, model: StageModel) -> None:
        """Load the state into a model, or only the weights if it is not compiled.

        The file must exist.
        """
        mend = "delete it to train the stage again"
        with untrusted.naming(self.path, "a checkpoint", mend), np.load(self.path) as stored:
            for index, variable in enumerate(_variables(model)):
                variable.assign(stored[f"arr_{index}"])


def _variables(model: StageModel) -> list[keras.Variable]:
    """Return all that later steps depend on; metrics are not among them."""
    weights = [variable for network in model.subnetworks.values() for variable in network.weights]
    return [*weights, *(model.optimizer.variables if model.compiled else [])]


def means(batches: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the mean of each number over batches, which all have the same; {} without batches."""
    names = batches[0] if batches else ()
    return {name: sum(float(one[name]) for one in batches) / len(batches) for name in names}


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

    def add(self, step: int, groups: Mapping[str, Mapping[str, float]]) -> None:
        """Append a row of numbers by group, the columns `group_name`, and write the file.

        Args:
            step: number of batches done.
            groups: `training`, mean losses since the row before, whose columns begin with `train_`;
                `validation`, mean losses on the validation set; `measure`, measures on it.
        """
        seconds = self._earlier + time.monotonic() - self._began
        row = {"step": str(step), "seconds": f"{seconds:.1f}"}
        for group, values in groups.items():
            prefix = "train" if group == "training" else group
            row |= {f"{prefix}_{name}": f"{value:.6g}" for name, value in values.items()}
        self._rows.append(row)
        columns = dict.fromkeys(name for one in self._rows for name in one)
        with (
            atomic.replacing(self._path) as partial,
            partial.open("w", newline="", encoding="utf-8") as file,
        ):
            writer = csv.DictWriter(file, list(columns))
            writer.writeheader()
            writer.writerows(self._rows)
