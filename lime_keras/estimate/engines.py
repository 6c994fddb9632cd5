"""The engines that run a model's networks: ONNX Runtime, or Keras where it is asked for."""

import sys
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Union

import numpy as np

from lime_keras import console
from lime_keras.model import folder as model_folder
from lime_keras.model import graphs as graph_folder

if TYPE_CHECKING:
    import keras

    from lime_keras.runtime.engine import OnnxEngine

ENGINES = ("onnx", "keras")
"""Names of the engines, the default first."""


Engine = Union["OnnxEngine", "KerasEngine"]
"""A loaded model that answers the outputs that are asked for (see `OnnxEngine`)."""


def load(run: Path, engine: str, *, streaming: bool = False) -> Engine:
    """Load a trained model.

    Args:
        run: run of `lime-train`, or folder of `lime_keras.model.weights.save`.
        engine: a name out of `ENGINES`. For `onnx` the run is exported, if it is not yet or if its
            weights have changed since; this takes half a minute and is told on standard error.
        streaming: whether ONNX Runtime keeps the memory of a run for the next one.

    Raises:
        FileNotFoundError: if the folder holds no trained model.
        ValueError: if the model's files are damaged, or there is no such engine.
        console.MissingExtra: if the engine, or the export, needs packages that are not installed.
        OSError: if the run has to be exported and its folder cannot be written to.
    """
    if engine not in ENGINES:
        raise ValueError(f"no engine {engine!r}: choose from {', '.join(ENGINES)}")
    return KerasEngine(run) if engine == "keras" else _onnx(run, streaming)


def _onnx(run: Path, streaming: bool) -> Engine:
    """Return the model in ONNX Runtime, exported before if need be."""
    digest, folder = model_folder.digest(run), model_folder.graphs(run)
    description = graph_folder.read(folder)
    if description is None or description.weights != digest:
        _export(run, folder)
        description = graph_folder.read(folder)
    if description is None:
        raise ValueError(f"{folder} was changed while it was read: try again")
    # ONNX Runtime is large, and a folder without a model is told without it.
    from lime_keras.runtime.engine import OnnxEngine

    return OnnxEngine(folder, description, streaming=streaming)


def _export(run: Path, folder: Path) -> None:
    console.require(f"{run} must first be exported for ONNX Runtime, which", *console.EXPORTING)
    print(f"{run} is exported to {folder}, once, for ONNX Runtime …", file=sys.stderr)
    console.import_tensorflow()
    from lime_keras.export.exporter import GRAPHS, export

    export(folder.parent, GRAPHS, run)


class KerasEngine:
    """The networks in Keras, with the attributes and methods of `OnnxEngine`."""

    def __init__(self, run: Path):
        console.require("the Keras engine", "keras")
        console.import_tensorflow()
        from lime_keras.model import weights
        from lime_keras.networks import output_names

        architecture, self._parts = weights.load(run)
        self._joined: dict[tuple[frozenset[str], ...], keras.Model] = {}
        self.size, self.system = architecture.size, architecture.description
        self.outputs = output_names(self._parts)

    def subnetworks(self, outputs: Iterable[str], given: Collection[str]) -> tuple[str, ...]:
        """Return the names of the subnetworks that outputs need, in the order of the model."""
        missing = set(outputs) - set(given)
        used = self._network(missing, given).layers if missing else []
        return tuple(name for name, part in self._parts.items() if part in used)

    def run(
        self, outputs: Collection[str], given: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Return outputs by name for a batch; only the subnetworks that they need are run.

        Raises:
            RuntimeError: in a forked child (`console.check_fork`).
        """
        console.check_fork()
        inputs = dict(given) if len(given) > 1 else given["image"]
        found = self._network(outputs, given).predict_on_batch(inputs)
        return {name: np.array(found[name]) for name in outputs}

    def _network(self, outputs: Collection[str], given: Collection[str]) -> "keras.Model":
        from lime_keras.networks import assemble

        key = frozenset(outputs), frozenset(given)
        if key not in self._joined:
            self._joined[key] = assemble(self._parts, sorted(outputs), given=set(given) - {"image"})
        return self._joined[key]
