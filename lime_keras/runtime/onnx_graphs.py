"""The graphs of a model in ONNX Runtime, one for each subnetwork, opened when first needed."""

import json
from collections.abc import Callable, Collection, Iterable
from functools import partial
from pathlib import Path

import numpy as np

from lime_keras.io import untrusted
from lime_keras.model import folder as model_folder
from lime_keras.model.folder import DESCRIPTION, SPLIT, Description, Graph
from lime_keras.outputs import OUTPUTS
from lime_keras.runtime.engine import Arrays
from lime_keras.runtime.sessions import Session


def load(run: Path, precision: str = "float32", *, streaming: bool = False) -> "OnnxGraphs":
    """Return the engine of a model's graphs (see `engine.load`)."""
    digest, folder = model_folder.digest(run), model_folder.graphs(run, precision)
    description = model_folder.read_description(folder)
    if description is None or description.weights != digest:
        lack = "holds no graphs" if description is None else "holds graphs of other weights"
        raise ValueError(f"{folder} {lack}: {model_folder.export_hint(run, precision)}")
    return OnnxGraphs(folder, description, streaming=streaming)


def open_folder(folder: Path) -> "OnnxGraphs":
    """Return the engine of a folder of graphs, whatever model they are of.

    Raises:
        ValueError: if the folder holds no graphs.
    """
    description = model_folder.read_description(folder)
    if description is None:
        raise ValueError(f"{folder} holds no graphs: write them with lime-export")
    return OnnxGraphs(folder, description)


def open_file(path: Path) -> "OnnxGraphs":
    """Return the engine of the one ONNX file of a whole model, by the card in it."""
    import onnx

    card = {one.key: one.value for one in onnx.load(path).metadata_props}
    graph = Graph(("image",), tuple(json.loads(card["outputs"])), untrusted.sha256(path))
    size = json.loads(card["input_shape"])[1]
    return OnnxGraphs(path.parent, Description("", size, card["description"], {path.stem: graph}))


class OnnxGraphs:
    """An `Engine` that opens and runs only the graphs that the outputs need.

    Args:
        folder: folder of the graphs (`model.folder.graphs`).
        description: description of the graphs in it.
        streaming: whether the memory of a run is kept for the next one.

    Attributes:
        folder: the folder.
        description: the description.
    """

    def __init__(self, folder: Path, description: Description, *, streaming: bool = False):
        self.folder, self.description, self._graphs = folder, description, description.graphs
        self._streaming = streaming
        self._sessions: dict[str, Session] = {}
        self.size, self.system = description.size, description.system
        answered = {output for graph in self._graphs.values() for output in graph.outputs}
        self.outputs = tuple(filter(answered.__contains__, OUTPUTS))

    def subnetworks(self, outputs: Iterable[str], inputs: Collection[str]) -> tuple[str, ...]:
        """Return the names of the subnetworks that outputs need (see `Engine`)."""
        return tuple(name for name in self.description.needed(outputs, inputs) if name != SPLIT)

    def run(self, outputs: Collection[str], inputs: Arrays) -> dict[str, np.ndarray]:
        """Return outputs by name for a batch (see `Engine`)."""
        values = dict(inputs)
        for name in self.description.needed(outputs, inputs):
            graph = self._graphs[name]
            fed = {quantity: values[quantity] for quantity in graph.inputs}
            session = self._session(name)
            try:
                results = session.run(graph.outputs, fed)
            except ValueError as error:
                raise ValueError(
                    f"{self.folder / DESCRIPTION} describes {name} as it is not ({error}): "
                    f"{model_folder.repair_hint(self.folder)}"
                ) from error
            values |= zip(graph.outputs, results, strict=True)
        return {output: values[output] for output in outputs}

    def _session(self, name: str) -> Session:
        if name not in self._sessions:
            content = partial(model_folder.read_verified, self.folder, name, self._graphs[name])
            self._sessions[name] = self._open(content)
        return self._sessions[name]

    def _open(self, content: Callable[[], bytes]) -> Session:
        return Session(content, streaming=self._streaming)
