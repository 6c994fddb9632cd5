"""Weights that a run begins with, in place of fresh ones.

The run keeps its own copy in `RUN/begun-from/`, so that it can be resumed without the model that
they came from; `taken.json` there says which subnetworks fitted.
"""

import hashlib
import json
import shutil
from collections.abc import Mapping
from pathlib import Path

import keras
import numpy as np

from lime_keras.io import atomic
from lime_keras.networks import SUBNETWORKS, weights

_FOLDER, _TAKEN = "begun-from", "taken.json"


def sha256(model: Path) -> str:
    """What identifies a trained model: its files, hashed.

    Raises:
        FileNotFoundError: if the folder holds no model.
    """
    digest = hashlib.sha256()
    for path in weights.files(model):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def keep(model: Path, run: Path) -> None:
    """Copy a trained model into a run that is to begin with it; one that is there stays."""
    if (run / _FOLDER).is_dir():
        return
    model = weights.folder(model)
    with atomic.replacing(run / _FOLDER) as partial:
        for path in weights.files(model):
            target = partial / path.relative_to(model)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)


def load(
    run: Path, subnetworks: Mapping[str, keras.Model]
) -> tuple[list[str], dict[str, list[np.ndarray]]]:
    """Set the subnetworks that have the same layers in the model that `keep` copied.

    U-Nets have them at any size of image; an encoder's first dense layer depends on it.

    Returns:
        Names of those, and the weights that the encoders among them had before they were joined;
        where the model does not hold such, those that it has.

    Raises:
        ValueError: if no subnetwork fits, or a file is broken.
    """
    _, others = weights.load(run / _FOLDER, whole=False)
    alone = others | weights.load_alone(run / _FOLDER, others)
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
    text = json.dumps({"taken": taken, "fresh": [n for n in subnetworks if n not in taken]})
    (run / _FOLDER / _TAKEN).write_text(text + "\n", encoding="utf-8")
    encoders = [name for name in taken if SUBNETWORKS[name].encoder]
    return taken, {name: alone[name].get_weights() for name in encoders}


def described(run: Path) -> str:
    """Which subnetworks began with weights of another run, in words."""
    found = json.loads((run / _FOLDER / _TAKEN).read_text(encoding="utf-8"))
    return ", ".join(
        f"{' and '.join(names)} {how}"
        for names, how in ((found["taken"], "continued"), (found["fresh"], "begun afresh"))
        if names
    )


def _fit(one: keras.Model, other: keras.Model) -> bool:
    return [w.shape for w in one.weights] == [w.shape for w in other.weights]
