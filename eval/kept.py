"""Results of measurements in one folder, so that a repeated command goes on where it was stopped.

A result is kept in a file of its own, named after a digest of what it follows from: the weights,
the corpus, the options, the version of this package, and for errors its code, which in a checkout
changes within a version. Another of these is another file. Times do not follow the code.
"""

import dataclasses
import functools
import hashlib
import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import lime_keras
from lime_keras.data.corpus import Split
from lime_keras.io import atomic, untrusted
from lime_keras.model import folder as model_folder
from lime_keras.networks import Architecture
from lime_keras.version import __version__

from .accuracy.evaluate import Evaluation, evaluate, evaluate_predictions
from .accuracy.predictions import Predictions

_DIGITS = 16


def value(folder: Path, name: str, inputs: Mapping[str, Any], make: Callable[[], Any]) -> Any:
    """Return a JSON result, read from its file, or made by `make` and kept.

    Args:
        folder: folder of the results; it is created with the first of them.
        name: beginning of the file's name.
        inputs: what the result follows from beside the version of the package, as JSON.
        make: function that makes the result.
    """
    path = _path(folder, name, inputs, ".json")
    content = untrusted.json_or_none(path)
    if content is not None:
        return content["result"]
    content = {"inputs": inputs, "result": make()}
    atomic.write(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
    return json.loads(json.dumps(content["result"]))


@functools.cache
def code() -> str:
    """Return a digest of the sources of this package and of the evaluation."""
    folders = Path(lime_keras.__file__).parent, Path(__file__).parent
    files = sorted(file for folder in folders for file in folder.rglob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def corpus_of(corpus: Path) -> dict[str, str]:
    """Return the part of `inputs` that names a test split; its manifest has the shards' checksums.

    Raises:
        FileNotFoundError: if the split is not complete.
    """
    split = Split(corpus, "test")
    split.shard_paths()
    return {"corpus": untrusted.sha256(split.manifest_path)}


def evaluation(folder: Path, run: Path, corpus: Path, *, camera: bool = False) -> Evaluation:
    """Return the evaluation kept for the same weights and images, or run `evaluate`.

    Raises:
        FileNotFoundError: if the weights or the test split are missing.
        ValueError: if `evaluate` refuses the split or the model's outputs.
    """
    of_what = {"weights": model_folder.digest(run), "code": code()}
    inputs = of_what | corpus_of(corpus) | {"camera": camera}
    path = _path(folder, "evaluation", inputs, ".npz")
    arrays = _arrays(path, lambda: _as_arrays(evaluate(run, corpus, camera=camera)))
    rows, true_mask = (
        {n.partition(".")[2]: column for n, column in arrays.items() if n.startswith(f"{kind}.")}
        for kind in ("rows", "true_mask")
    )
    return Evaluation(rows, true_mask, Architecture(**json.loads(str(arrays["architecture"]))))


def predictions(folder: Path, answers: Predictions, corpus: Path) -> dict[str, np.ndarray]:
    """Return the rows kept for the same answers and images, or run `evaluate_predictions`.

    Raises:
        FileNotFoundError: if the test split is missing.
        ValueError: if `evaluate_predictions` refuses the split or an answer.
    """
    inputs = {"predictions": answers.digest(), "code": code()} | corpus_of(corpus)
    path = _path(folder, "predictions", inputs, ".npz")
    return _arrays(path, lambda: evaluate_predictions(answers, corpus))


def _arrays(path: Path, make: Callable[[], Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Return arrays of numbers, truth values or text by name, read from their file, or made."""
    try:
        with path.open("rb") as stored, np.load(stored) as known:
            return dict(known)
    except (OSError, EOFError, ValueError, zipfile.BadZipFile):
        pass  # not there, or damaged after it was written
    arrays: Any = make()
    with atomic.replacing(path) as partial, partial.open("wb") as file:
        np.savez(file, **arrays)
    return dict(arrays)


def _path(folder: Path, name: str, inputs: Mapping[str, Any], suffix: str) -> Path:
    text = json.dumps({"version": __version__, "inputs": inputs}, sort_keys=True)
    digest = hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]
    return folder / f"{name}-{digest}{suffix}"


def _as_arrays(found: Evaluation) -> dict[str, np.ndarray]:
    return {
        **{f"rows.{name}": column for name, column in found.rows.items()},
        **{f"true_mask.{name}": column for name, column in found.true_mask.items()},
        "architecture": np.array(json.dumps(dataclasses.asdict(found.architecture))),
    }
