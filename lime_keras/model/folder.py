"""The folder of a trained model: where its files lie, and the digest that identifies its weights.

A model's weights lie in files of Keras, one for each subnetwork; or, as in the sets that come with
the package, in its exported graphs alone, which Keras reads, too, so that nothing lies there twice.

`lime_keras.model.weights` writes and reads the files. This module imports neither Keras nor
NumPy, so that the estimator, which runs the exported graphs, finds its model without them.
"""

import hashlib
from pathlib import Path
from typing import Any

from lime_keras.io import untrusted

PRETRAINED = Path(__file__).parents[1] / "pretrained"
"""Folder of the sets of weights that come with the package, a folder each."""
SHIPPED = PRETRAINED / "live"
"""Folder of the set that cameras, exports and evaluations use where no model is named."""
FOR_PHOTOS = PRETRAINED / "best"
"""Folder of the set that photos and videos use instead: it takes twice the time, and finds more
objects whole."""
ARCHITECTURE = "architecture.json"
"""File of the architecture; only a folder that has one holds a model."""
WEIGHTS = ".weights.h5"  # end of the name of each subnetwork's file
DESCRIPTION = "graphs.json"
"""File that describes the exported graphs, beside them (`lime_keras.model.graphs`)."""


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
    """Return whether a model's weights lie in its exported graphs alone.

    Args:
        run: folder of the trained model (see `folder`).
    """
    held = any(folder(run).glob(f"*{WEIGHTS}"))
    return not held and (graphs(run) / DESCRIPTION).is_file()


def files(run: Path) -> list[Path]:
    """Return all files of a model, in a fixed order.

    Args:
        run: folder of the trained model (see `folder`).

    Raises:
        FileNotFoundError: if the folder holds no model.
    """
    model = folder(run)
    check_present(model, model / ARCHITECTURE)
    held = model.glob(f"*{WEIGHTS}")
    if has_weights_in_graphs(run):
        there = graphs(run)
        held = (there / f"{name}.onnx" for name in _described(there))
    return [model / ARCHITECTURE, *(path for path in sorted(held) if path.is_file())]


def training_config(run: Path) -> dict[str, Any]:
    """Return the config that a model was trained with; empty for a model without a record.

    Args:
        run: folder of the trained model (see `folder`).

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

    Args:
        run: folder of the trained model (see `folder`).

    Raises:
        FileNotFoundError: if the folder holds no model.
        ValueError: if the description of the graphs, which hold the weights, is damaged.
    """
    paths, total = files(run), hashlib.sha256()
    if has_weights_in_graphs(run):
        return _described_digest(graphs(run) / DESCRIPTION)
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


def _described(graphs: Path) -> list[str]:
    """Return the names of the described graphs; none without a description that can be read."""
    try:
        return list(untrusted.read_json(graphs / DESCRIPTION)["graphs"])
    except (OSError, ValueError, LookupError, TypeError):
        return []


def _described_digest(description: Path) -> str:
    try:
        return str(untrusted.read_json(description)["weights"])
    except (ValueError, LookupError, TypeError) as error:
        raise ValueError(
            f"{description} is damaged, and the graphs beside it hold the only weights: take this "
            "folder from where it came from again"
        ) from error
