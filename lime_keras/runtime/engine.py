"""The run of exported graphs in ONNX Runtime, each opened when it is first needed."""

from collections.abc import Collection, Iterable, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from lime_keras.model import graphs as graph_folder
from lime_keras.model.folder import DESCRIPTION
from lime_keras.model.graphs import SPLIT, Description
from lime_keras.outputs import OUTPUTS
from lime_keras.runtime.sessions import Session

_LONGEST = 200
"""Largest number of characters of ONNX Runtime's own words that are told."""
_NO_MEMORY = ("bad_alloc", "Failed to allocate memory")
"""Words by which ONNX Runtime tells that memory is used up, in errors of its own classes."""


class OnnxEngine:
    """The graphs of a model, which answer the outputs that are asked for.

    Args:
        folder: folder of the graphs (`graph_folder`).
        description: description of the graphs in it (`graph_folder.read`).
        streaming: whether the memory of a run is kept for the next one, which makes small batches
            faster.

    Attributes:
        size: height and width of the images in pixels.
        system: name of the system in words.
        outputs: names of the outputs that the model has, out of `outputs.OUTPUTS`.
    """

    def __init__(self, folder: Path, description: Description, *, streaming: bool = False):
        self._folder, self._graphs = folder, description.graphs
        self._streaming = streaming
        self._sessions: dict[str, Session] = {}
        self.size, self.system = description.size, description.system
        answered = {output for graph in self._graphs.values() for output in graph.outputs}
        self.outputs = tuple(filter(answered.__contains__, OUTPUTS))

    def subnetworks(self, outputs: Iterable[str], given: Collection[str]) -> tuple[str, ...]:
        """Return the names of the subnetworks that outputs need, each after those it reads.

        Args:
            outputs: names out of `self.outputs`.
            given: names of the quantities that are given: `image`, or `image` and `mask`.
        """
        return tuple(name for name in self._needed(outputs, given) if name != SPLIT)

    def run(
        self, outputs: Collection[str], given: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Return outputs by name for a batch; only the subnetworks that they need are run.

        Args:
            outputs: names out of `self.outputs`.
            given: `image` `(B, S, S, 3)` float32, sRGB in [0, 1]; and `mask` `(B, S, S, 1)` float32
                in [0, 1], unless the object is to be found.

        Raises:
            ValueError: if a graph's file is missing or damaged, or it is no graph as described.
            MemoryError: if memory is used up.
        """
        values = dict(given)
        for name in self._needed(outputs, given):
            graph = self._graphs[name]
            fed = {quantity: values[quantity] for quantity in graph.inputs}
            session = self._session(name)
            try:
                found = session.run(graph.outputs, fed)
            except MemoryError:
                raise
            except Exception as error:  # ONNX Runtime's own classes have no common base.
                told = " ".join(str(error).split())[:_LONGEST]
                if any(words in told for words in _NO_MEMORY):
                    raise MemoryError(told) from error
                raise ValueError(
                    f"{self._folder / DESCRIPTION} describes {name} as it is not ({told}): "
                    f"{graph_folder.mend(self._folder)}"
                ) from error
            values |= zip(graph.outputs, found, strict=True)
        return {output: values[output] for output in outputs}

    def _needed(self, outputs: Iterable[str], given: Collection[str]) -> list[str]:
        """Return the names of the graphs that outputs need, each after those it reads."""
        answering = {
            output: name for name, graph in self._graphs.items() for output in graph.outputs
        }
        needed, open_names = set(), set(outputs) - set(given)
        while open_names:
            name = answering[open_names.pop()]
            if name not in needed:
                needed.add(name)
                open_names |= set(self._graphs[name].inputs) - set(given)
        return [name for name in self._graphs if name in needed]

    def _session(self, name: str) -> Session:
        if name not in self._sessions:
            content = partial(graph_folder.checked, self._folder, name, self._graphs[name])
            self._sessions[name] = Session(content, streaming=self._streaming)
        return self._sessions[name]
