"""Evaluations kept on disk, so that a repeated command continues where the last one stopped."""

import dataclasses
import hashlib
import json
from pathlib import Path

import numpy as np

from lime_keras.data.corpus import Split
from lime_keras.model import folder as model_folder
from lime_keras.networks import Architecture

from ..source_code import code_of
from ..store import DependsOn, Store, sha256
from .evaluate import Evaluation, evaluate, evaluate_predictions
from .predictions import Predictions


def evaluation(store: Store, model_dir: Path, corpus: Path, *, camera: bool = False) -> Evaluation:
    """Return the evaluation kept for the same weights, images and code, or run `evaluate`.

    Args:
        store: store that keeps the evaluation.
        model_dir: folder of `weights.save`, or a run of `lime-train`.
        corpus: folder with a complete `test` split.
        camera: show the system photos of the scenes.

    Raises:
        FileNotFoundError: if the weights or the test split are missing.
        ValueError: if `evaluate` refuses the split or the model's outputs.
    """
    split = Split(corpus, "test")
    split.shard_paths()  # Raises if the split is incomplete.
    depends_on = {
        "weights": sha256(*model_folder.files(model_dir)),
        # The manifest holds the checksums of the shards.
        "manifest": sha256(split.manifest_path),
        "camera": camera,
    }
    arrays = store.arrays(
        _name(depends_on),
        depends_on,
        lambda: _as_arrays(evaluate(model_dir, corpus, camera=camera)),
        code=code_of(__name__),
    )
    return _from_arrays(arrays)


def predictions(store: Store, found: Predictions, corpus: Path) -> dict[str, np.ndarray]:
    """Return the rows kept for the same answers, images and code, or run `evaluate_predictions`.

    Args:
        store: store that keeps the rows.
        found: files of the answers of another system.
        corpus: folder with a complete `test` split.

    Raises:
        FileNotFoundError: if the test split is missing.
        ValueError: if `evaluate_predictions` refuses the split or an answer.
    """
    split = Split(corpus, "test")
    split.shard_paths()  # Raises if the split is incomplete.
    depends_on = {"predictions": found.digest(), "manifest": sha256(split.manifest_path)}
    return store.arrays(
        _name(depends_on),
        depends_on,
        lambda: evaluate_predictions(found, corpus),
        code=code_of(__name__),
    )


def _name(depends_on: DependsOn) -> str:
    """Return the name of an evaluation's own file, so that none overwrites another's."""
    return f"evaluations/{hashlib.sha256(json.dumps(depends_on).encode()).hexdigest()[:16]}"


def _as_arrays(found: Evaluation) -> dict[str, np.ndarray]:
    return {
        **{f"rows.{name}": column for name, column in found.rows.items()},
        **{f"true_mask.{name}": column for name, column in found.true_mask.items()},
        "architecture": np.array(json.dumps(dataclasses.asdict(found.architecture))),
    }


def _from_arrays(arrays: dict[str, np.ndarray]) -> Evaluation:
    def of(kind: str) -> dict[str, np.ndarray]:
        return {
            n.partition(".")[2]: column for n, column in arrays.items() if n.startswith(f"{kind}.")
        }

    architecture = Architecture(**json.loads(str(arrays["architecture"])))
    return Evaluation(of("rows"), of("true_mask"), architecture)
