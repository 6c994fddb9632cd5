"""The folder of a trained model: its files, the digest of its weights, and its exported graphs.

A model's weights lie in files of Keras, one for each subnetwork; or, as in the sets that come with
the package, in its exported graphs alone, which Keras reads, too, so that nothing lies there twice.

The folder of the graphs holds `SUBNETWORK.onnx` for each; for subnetworks that read the split of
colours `dichromatic.onnx`, too; and `graphs.json`. It names the weights that the graphs were
exported from, so graphs of other weights are noticed, and what each graph reads and answers, so
that only those are opened that are needed.

`lime_keras.model.weights` writes and reads the files. This module imports neither Keras nor
NumPy, so that the estimator, which runs the exported graphs, finds its model without them. `run` is
the folder of a trained model, as `folder` takes it.
"""

import dataclasses
import hashlib
import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lime_keras.io import untrusted
from lime_keras.version import __version__

PRETRAINED = Path(__file__).parents[1] / "pretrained"
"""Folder of the sets of weights that come with the package, a folder each."""
DEFAULT = PRETRAINED / "live"
"""Folder of the set that cameras, exports and evaluations use where no model is named."""
FOR_PHOTOS = PRETRAINED / "best"
"""Folder of the set that photos and videos use instead: it takes half as long again, and finds
more objects whole."""
ARCHITECTURE = "architecture.json"
"""File of the architecture; only a folder that has one holds a model."""
WEIGHTS = ".weights.h5"  # end of the name of each subnetwork's file
DESCRIPTION = "graphs.json"  # file that describes the exported graphs, beside them
ENGINES = ("onnx", "keras")  # names of what runs a model's folder, the default first
PRECISIONS = ("float32", "float16", "int8")  # precisions of a model's graphs, the default first
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
        weights: digest of the weights that were exported (`digest`).
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


def shipped() -> dict[str, Path]:
    """Return the folders of the sets of weights that come with the package, by name."""
    return {path.name: path for path in sorted(PRETRAINED.iterdir()) if _holds_model(path)}


def find(model: str | Path) -> Path:
    """Return the folder of the model that a user names.

    Args:
        model: folder of a trained model (see `folder`), or name of a set that comes with the
            package. A folder of that name counts only if it holds a model. Whether the folder that
            is returned holds one is not checked.
    """
    named = shipped().get(str(model))
    return Path(model) if named is None or _holds_model(Path(model)) else named


def folder(run: Path) -> Path:
    """Return the folder of the model: `model/` of a run of `lime-train`, else the folder itself."""
    run = Path(run)
    return run / "model" if (run / "model").is_dir() else run


def graphs(run: Path, precision: str = "float32") -> Path:
    """Return the folder of the model's exported graphs: `onnx/` of the run, beside `model/`.

    Graphs of another precision lie beside it, such as `onnx-int8/`. A model that lies in a folder
    of another name has its graphs inside that folder.
    """
    model = folder(run)
    home = model.parent if model.name == "model" else model
    return home / ("onnx" if precision == "float32" else f"onnx-{precision}")


def has_weights_in_graphs(run: Path) -> bool:
    """Return whether a model's weights lie in its exported graphs alone."""
    has_files = any(folder(run).glob(f"*{WEIGHTS}"))
    return not has_files and (graphs(run) / DESCRIPTION).is_file()


def files(run: Path) -> list[Path]:
    """Return all files of a model, in a fixed order.

    Raises:
        FileNotFoundError: if the folder holds no model.
    """
    model = folder(run)
    check_present(model, model / ARCHITECTURE)
    paths = model.glob(f"*{WEIGHTS}")
    if has_weights_in_graphs(run):
        there = graphs(run)
        description = read_description(there)
        paths = (there / f"{name}.onnx" for name in (description.graphs if description else ()))
    return [model / ARCHITECTURE, *(path for path in sorted(paths) if path.is_file())]


def training_config(run: Path) -> dict[str, Any]:
    """Return the config that a model was trained with; empty for a model without a record.

    Raises:
        ValueError: if the record, `config.json` of a run or `training.json` of a model, is broken.
    """
    for path in (run / "config.json", folder(run) / "training.json"):
        if path.is_file():
            with untrusted.naming(path, "record of a training"):
                return dict(untrusted.read_json(path).get("config", {}))
    return {}


def lobe(run: Path) -> str:
    """Return the lobe of the S that a model learnt, which decides the unit of its m_s.

    It is one of `lime_keras.data.corpus.LOBES`; `furnace` for a model without a record. Arguments
    and errors are those of `training_config`.
    """
    return str(training_config(run).get("lobe", "furnace"))


def digest(run: Path) -> str:
    """Return the SHA-256 of the model that the estimator runs: its architecture and weights.

    If the weights lie in the exported graphs alone, it is that of the files from which these were
    exported.

    Raises:
        FileNotFoundError: if the folder holds no model.
        ValueError: if the description of the graphs, which hold the weights, is damaged.
    """
    paths, total = files(run), hashlib.sha256()
    if has_weights_in_graphs(run):
        description = read_description(graphs(run))
        if description is None:
            raise ValueError(
                f"{graphs(run) / DESCRIPTION} is damaged, and the graphs beside it hold the only "
                "weights: take this folder from where it came from again"
            )
        return description.weights
    for path in paths:
        total.update(f"{path.name} {path.stat().st_size}\n".encode())
        total.update(path.read_bytes())
    return total.hexdigest()


def check_present(model: Path, *paths: Path) -> None:
    """Raise FileNotFoundError if a file of a model's folder is missing."""
    missing = [path for path in paths if not path.is_file()]
    if missing:
        raise FileNotFoundError(
            f"{missing[0]} is missing, so {model} holds no trained model: pass a folder that "
            "`lime-train` wrote to the end, or the name of a set that comes with the package: "
            f"{', '.join(shipped())}"
        )


def _holds_model(run: Path) -> bool:
    return (folder(run) / ARCHITECTURE).is_file()


def write_description(folder: Path, description: Description) -> None:
    """Write `graphs.json` into a folder that holds the graphs."""
    about = {"package": "lime-keras", "version": __version__, "layout": LAYOUT}
    text = json.dumps(about | dataclasses.asdict(description), indent=1)
    (folder / DESCRIPTION).write_text(text + "\n", encoding="utf-8")


def read_description(folder: Path) -> Description | None:
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
    if folder.is_relative_to(PRETRAINED):
        return "install the package again"
    if has_weights_in_graphs(folder.parent) and folder == graphs(folder.parent):
        return f"take {folder}, which holds the only weights, from where it came from again"
    precision = folder.name.removeprefix("onnx").lstrip("-") or "float32"
    return export_hint(folder.parent, precision)


def export_hint(run: Path, precision: str = "float32") -> str:
    """Return which command writes a model's graphs, as the end of an error's sentence."""
    more = "" if precision == "float32" else f" --precision {precision}"
    more += " --corpus CORPUS" if precision == "int8" else ""
    home = graphs(run).parent
    if not home.is_relative_to(PRETRAINED):
        return f"run `lime-export {home} --format graphs --weights {run}{more}`"
    if precision == "float32":
        return "install the package again"
    command = f"lime-export OUT --format graphs --weights {home.name}{more}"
    return f"run `{command}`, and pass OUT as the weights"
