"""The folder of a trained model: where its files lie, and the digest that identifies its weights.

`lime_keras.networks.weights` writes and reads the files. This module imports neither Keras nor
NumPy, so that the estimator, which runs the exported graphs, finds its model without them.
"""

import hashlib
from pathlib import Path

SHIPPED = Path(__file__).parents[1] / "pretrained" / "live"
"""Folder of the model that comes with the package, used where no other model is named."""
ARCHITECTURE = "architecture.json"
"""File of the architecture; only a folder that has one holds a model."""
WEIGHTS = ".weights.h5"
"""End of the name of each subnetwork's file."""


def folder(run: Path) -> Path:
    """Return the folder of the model: `model/` of a run of `lime-train`, else the folder itself."""
    run = Path(run)
    return run / "model" if (run / "model").is_dir() else run


def graphs(run: Path) -> Path:
    """Return the folder of the model's exported graphs: `onnx/` of the run, beside `model/`.

    A model that lies in a folder of another name has its graphs inside that folder.
    """
    model = folder(run)
    return (model.parent if model.name == "model" else model) / "onnx"


def files(run: Path) -> list[Path]:
    """Return all files of a model, weights from before joined training included, in a fixed order.

    Args:
        run: folder of the trained model (see `folder`).

    Raises:
        FileNotFoundError: if the folder holds no model.
    """
    model = folder(run)
    check_present(model, model / ARCHITECTURE)
    return [model / ARCHITECTURE, *sorted(model.rglob(f"*{WEIGHTS}"))]


def digest(run: Path) -> str:
    """Return the SHA-256 of the model that the estimator runs: its architecture and weights.

    Weights from before joined training do not count.

    Args:
        run: folder of the trained model (see `folder`).

    Raises:
        FileNotFoundError: if the folder holds no model.
    """
    model, total = folder(run), hashlib.sha256()
    for path in files(run):
        if path.parent == model:
            total.update(f"{path.name} {path.stat().st_size}\n".encode())
            total.update(path.read_bytes())
    return total.hexdigest()


def check_present(model: Path, *paths: Path) -> None:
    """Raise FileNotFoundError if a file of a model's folder is missing."""
    missing = [path for path in paths if not path.is_file()]
    if missing:
        raise FileNotFoundError(
            f"{missing[0]} is missing, so {model} holds no trained model: pass a folder that "
            "`lime-train` wrote to the end"
        )
