"""Evaluations kept on disk, so that a command that is run again goes on where it stopped."""

import dataclasses
import hashlib
import json
import zipfile
from pathlib import Path

import numpy as np

from lime_keras.data.corpus import Split
from lime_keras.io import atomic
from lime_keras.networks import Architecture, weights
from lime_keras.version import __version__

from .accuracy.evaluate import Evaluation, evaluate

_MEASURED_BY = ("evaluate.py", "flip.py", "relighting.py", "tone.py")
"""Files of this package that an evaluation's numbers come from."""


def evaluation(folder: Path, model_dir: Path, corpus: Path, *, camera: bool = False) -> Evaluation:
    """`evaluate`, or what an earlier call with the same weights, images and code has kept.

    Args:
        folder: of the kept files.
        model_dir: folder of `weights.save`, or a run of `lime-train`.
        corpus: folder with a complete `test` split.
        camera: show the system photos of the scenes.
    """
    path = folder / f"{key(model_dir, corpus, camera)}.npz"
    try:
        return _read(path)
    except (OSError, KeyError, ValueError, zipfile.BadZipFile):
        pass  # Not there, or not whole: evaluated again.
    found = evaluate(model_dir, corpus, camera=camera)
    with atomic.replacing(path) as partial:
        _write(partial, found)
    return found


def key(model_dir: Path, corpus: Path, camera: bool) -> str:
    """What an evaluation follows from, as a hash: weights, images, the camera and this code."""
    split = Split(corpus, "test")
    split.shard_paths()  # Refuses a split that is incomplete.
    digest = hashlib.sha256(f"{__version__} {camera}".encode())
    digest.update(split.manifest_path.read_bytes())
    for path in weights.files(model_dir):
        digest.update(path.name.encode() + path.read_bytes())
    for name in _MEASURED_BY:
        digest.update(Path(__file__).with_name(name).read_bytes())
    return digest.hexdigest()[:32]


def _write(path: Path, found: Evaluation) -> None:
    columns = {f"rows.{name}": column for name, column in found.rows.items()}
    columns |= {f"oracle.{name}": column for name, column in found.oracle.items()}
    architecture = json.dumps(dataclasses.asdict(found.architecture))
    with path.open("wb") as file:
        np.savez(file, confusion=found.confusion, architecture=architecture, **columns)


def _read(path: Path) -> Evaluation:
    with np.load(path) as stored:

        def of(kind: str) -> dict[str, np.ndarray]:
            names = [name for name in stored.files if name.startswith(f"{kind}.")]
            return {name.partition(".")[2]: stored[name] for name in names}

        architecture = Architecture(**json.loads(str(stored["architecture"])))
        return Evaluation(of("rows"), of("oracle"), stored["confusion"], architecture)
