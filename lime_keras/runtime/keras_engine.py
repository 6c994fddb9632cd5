"""The networks in Keras, under any of its backends."""

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lime_keras import console
from lime_keras.runtime.engine import Arrays

if TYPE_CHECKING:
    import keras


class KerasEngine:
    """An `Engine` that joins the subnetworks that the outputs need.

    Args:
        run: run of `lime-train`, or folder of `lime_keras.model.weights.save`.

    Attributes:
        architecture: architecture of the subnetworks.
        parts: subnetworks by name, none before another that it reads.

    Raises:
        FileNotFoundError: if the folder holds no trained model.
        ValueError: if the model's files are damaged.
        console.MissingExtra: if Keras is not installed.
    """

    def __init__(self, run: Path):
        console.require("the Keras engine", "keras")
        console.import_tensorflow()
        from lime_keras.model import weights
        from lime_keras.networks import output_names

        self.architecture, self.parts = weights.load(run)
        self._joined: dict[tuple[frozenset[str], bool], keras.Model] = {}
        self.size, self.system = self.architecture.size, self.architecture.description
        self.outputs = output_names(self.parts)

    def subnetworks(self, outputs: Iterable[str], inputs: Collection[str]) -> tuple[str, ...]:
        """Return the names of the subnetworks that outputs need (see `Engine`)."""
        missing = set(outputs) - set(inputs)
        used = self._network(missing, inputs).layers if missing else []
        return tuple(name for name, part in self.parts.items() if part in used)

    def run(self, outputs: Collection[str], inputs: Arrays) -> dict[str, np.ndarray]:
        """Return outputs by name for a batch (see `Engine`)."""
        console.check_fork()
        fed = dict(inputs) if len(inputs) > 1 else inputs["image"]
        answer = self._network(outputs, inputs).predict_on_batch(fed)
        return {name: np.array(answer[name]) for name in outputs}

    def _network(self, outputs: Collection[str], inputs: Collection[str]) -> "keras.Model":
        from lime_keras.networks import assemble

        key = frozenset(outputs), "mask" in inputs
        if key not in self._joined:
            self._joined[key] = assemble(self.parts, sorted(outputs), with_mask="mask" in inputs)
        return self._joined[key]
