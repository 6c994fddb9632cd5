"""The folder of a model's exported graphs: `SUBNETWORK.onnx` for each, and `graphs.json`.

A model whose subnetworks read the split of colours has a graph for it, too, `dichromatic.onnx`.

`graphs.json` names the weights that the graphs were exported from, so graphs of other weights are
noticed, and what each graph reads and answers, so that only those are opened that are needed.
"""

import dataclasses
import hashlib
import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from lime_keras.io import untrusted
from lime_keras.model import folder as model_folder
from lime_keras.model.folder import DESCRIPTION
from lime_keras.version import __version__

LAYOUT = 1  # version of the graphs' names and meanings; it rises when earlier graphs no longer fit
SPLIT = "dichromatic"
"""Name of the graph that is no subnetwork, and of its only answer: the split of colours, which
several subnetworks read (`lime_keras.optics.dichromatic`)."""


@dataclass(frozen=True)
class Graph:
    """The description of one graph.

    Attributes:
        inputs: names of what it reads (see `lime_keras.export.standalone`).
        outputs: names of what it answers.
        sha256: checksum of its file.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    sha256: str


@dataclass(frozen=True)
class Description:
    """The content of `graphs.json`.

    Attributes:
        weights: digest of the weights that were exported (`model.folder.digest`).
        size: height and width of the images in pixels.
        system: name of the system in words, such as `LIME without MirrorNet`.
        graphs: description of each graph by name; each comes after those whose outputs it reads.
    """

    weights: str
    size: int
    system: str
    graphs: Mapping[str, Graph]

    def needed(self, quantities: Iterable[str], given: Collection[str]) -> list[str]:
        """Return the names of the graphs that quantities need, each after those it reads.

        Args:
            quantities: names out of the graphs' outputs, or of what is given.
            given: names of the quantities that need no graph.
        """
        answering = {
            output: name for name, graph in self.graphs.items() for output in graph.outputs
        }
        needed, open_names = set(), set(quantities) - set(given)
        while open_names:
            name = answering[open_names.pop()]
            if name not in needed:
                needed.add(name)
                open_names |= set(self.graphs[name].inputs) - set(given)
        return [name for name in self.graphs if name in needed]


def write(folder: Path, description: Description) -> None:
    """Write `graphs.json` into a folder that holds the graphs."""
    about = {"package": "lime-keras", "version": __version__, "layout": LAYOUT}
    text = json.dumps(about | dataclasses.asdict(description), indent=1)
    (folder / DESCRIPTION).write_text(text + "\n", encoding="utf-8")


def read(folder: Path) -> Description | None:
    """Return the description of a folder's graphs; None if it holds none of this layout."""
    try:
        content = untrusted.read_json(folder / DESCRIPTION)
        if content["layout"] != LAYOUT:
            return None
        graphs = {
            name: Graph(tuple(row["inputs"]), tuple(row["outputs"]), row["sha256"])
            for name, row in content["graphs"].items()
        }
        description = Description(content["weights"], content["size"], content["system"], graphs)
        return description if _is_sound(description) else None
    except (AttributeError, LookupError, TypeError, ValueError):
        return None  # a description that cannot be read counts as none


def _is_sound(description: Description) -> bool:
    """Return whether the fields have their types, and no graph reads what a later one answers."""
    texts = (description.weights, description.system, *description.graphs)
    answered: set[str] = set()
    for graph in description.graphs.values():
        texts += (*graph.inputs, *graph.outputs, graph.sha256)
        if not set(graph.inputs) <= {"image", "mask"} | answered:
            return False
        answered |= set(graph.outputs)
    is_size = type(description.size) is int and description.size > 0
    return is_size and "mask" in answered and all(isinstance(text, str) for text in texts)


def read_verified(folder: Path, name: str, graph: Graph) -> bytes:
    """Return the content of a graph's file.

    Args:
        folder: folder of the graphs.
        name: name of the subnetwork.
        graph: its graph, as the folder's description says.

    Raises:
        ValueError: if the file is missing or is not the one described.
    """
    file = folder / f"{name}.onnx"
    content = file.read_bytes() if file.is_file() else b""
    if hashlib.sha256(content).hexdigest() != graph.sha256:
        raise ValueError(f"{file} is missing or damaged: {repair_hint(folder)}")
    return content


def repair_hint(folder: Path) -> str:
    """Return what to do about a damaged folder of graphs, as the end of an error's sentence."""
    if folder.is_relative_to(model_folder.PRETRAINED):
        return "install the package again"
    if model_folder.has_weights_in_graphs(folder.parent) and folder == model_folder.graphs(
        folder.parent
    ):
        return f"take {folder}, which holds the only weights, from where it came from again"
    precision = folder.name.removeprefix("onnx").lstrip("-") or "float32"
    return export_hint(folder.parent, precision)


def export_hint(run: Path, precision: str = "float32") -> str:
    """Return which command writes a model's graphs, as the end of an error's sentence.

    Args:
        run: folder of the trained model (see `folder`).
        precision: precision of the graphs.
    """
    more = "" if precision == "float32" else f" --precision {precision}"
    more += " --corpus CORPUS" if precision == "int8" else ""
    home = model_folder.graphs(run).parent
    if not home.is_relative_to(model_folder.PRETRAINED):
        return f"run `lime-export {home} --format graphs --weights {run}{more}`"
    if precision == "float32":
        return "install the package again"
    command = f"lime-export OUT --format graphs --weights {home.name}{more}"
    return f"run `{command}`, and pass OUT as the weights"
