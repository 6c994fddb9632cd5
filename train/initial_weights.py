"""The weights of a trained model that a run begins with, in place of fresh weights.

The run keeps a copy of the model in `RUN/begun-from/`, so that it can be resumed without the
original. `taken.json` there names the subnetworks whose weights were taken.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import keras

from lime_keras.io import atomic, untrusted
from lime_keras.model import folder as model_folder
from lime_keras.model import weights

_FOLDER, _TAKEN = "begun-from", "taken.json"


def sha256(model: Path) -> str:
    """Return a hash that identifies a trained model: of all its files.

    Raises:
        FileNotFoundError: if the folder holds no model.
    """
    digest = hashlib.sha256()
    for path in model_folder.files(model):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def keep(model: Path, run: Path) -> None:
    """Copy a trained model into the run that begins with it, unless the run holds a copy."""
    if (run / _FOLDER).is_dir():
        return
    with atomic.replacing(run / _FOLDER) as partial:
        weights.copy(model, partial)


def load(run: Path, subnetworks: Mapping[str, keras.Model], *, record: bool = True) -> list[str]:
    """Set the weights of those subnetworks that have the same layers in the copied model.

    A U-Net's layers are the same for any image size; an encoder's first dense layer depends on it.

    Args:
        run: folder of the run.
        subnetworks: subnetworks of the run by name.
        record: whether to write down in `taken.json` which of them were set.

    Returns:
        Names of the subnetworks that were set.

    Raises:
        ValueError: if no subnetwork fits, or a file is broken.
    """
    _, others = weights.load(run / _FOLDER, whole=False)
    taken = [
        name for name in subnetworks if name in others and _fit(subnetworks[name], others[name])
    ]
    if not taken:
        raise ValueError(
            f"none of the subnetworks in {run / _FOLDER} has the layers of {run}'s: leave out "
            "--start-from, or pass the --width and --preset that it was trained with"
        )
    for name in taken:
        subnetworks[name].set_weights(others[name].get_weights())
    if record:
        text = json.dumps({"taken": taken, "fresh": [n for n in subnetworks if n not in taken]})
        atomic.write(run / _FOLDER / _TAKEN, text + "\n")
    return taken


def described(run: Path) -> str:
    """Return in words which subnetworks began with the model's weights, and which afresh."""
    path = run / _FOLDER / _TAKEN
    try:
        found = untrusted.read_json(path)
        return ", ".join(
            f"{' and '.join(names)} {how}"
            for names, how in ((found["taken"], "continued"), (found["fresh"], "begun afresh"))
            if names
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} names no subnetworks ({error}): begin another run") from error


def _fit(one: keras.Model, other: keras.Model) -> bool:
    return [w.shape for w in one.weights] == [w.shape for w in other.weights]
