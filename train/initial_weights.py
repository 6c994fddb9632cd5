"""The weights of a trained model that a run begins with, in place of fresh weights.

The run keeps a copy of the model in `RUN/begun-from/`, so that it can be resumed without the
original.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path

import keras
import numpy as np
from keras import ops

from lime_keras.io import atomic
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.networks.architecture import ENCODER_BLOCKS

_FOLDER = "begun-from"


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


def load(run: Path, subnetworks: Mapping[str, keras.Model]) -> list[str]:
    """Set the weights of those subnetworks that have the same layers in the copied model.

    A U-Net's layers are the same for any image size. An encoder's first dense layer depends on it:
    if the copied model sees images of another size, its kernel is resampled.

    Returns:
        Names of the subnetworks that were set.

    Raises:
        ValueError: if no subnetwork fits, or a file is broken.
    """
    _, others = weights.load(run / _FOLDER, whole=False)
    fitting = {
        name: values
        for name, network in subnetworks.items()
        if name in others and (values := _fit(network, others[name])) is not None
    }
    if not fitting:
        raise ValueError(
            f"none of the subnetworks in {run / _FOLDER} has the layers of {run}'s: leave out "
            "--start-from, or pass the --width and --preset that it was trained with"
        )
    for name, values in fitting.items():
        subnetworks[name].set_weights(values)
    return list(fitting)


def _fit(network: keras.Model, other: keras.Model) -> list[np.ndarray] | None:
    """Return the weights of another network for this one, or None if its layers differ."""
    cells, before = (one.inputs[0].shape[1] // 2**ENCODER_BLOCKS for one in (network, other))
    values = other.get_weights()
    if len(values) != len(network.weights):
        return None
    for index, weight in enumerate(network.weights):
        if cells != before and weight.path.endswith("dense1/kernel"):
            values[index] = _resample(values[index], before, cells)
        if values[index].shape != weight.shape:
            return None
    return values


def _resample(kernel: np.ndarray, before: int, now: int) -> np.ndarray:
    """Resample the kernel of a dense layer that reads `before` × `before` cells to `now` × `now`.

    The sum over the cells stays what it was, so even features give the same answer.
    """
    maps = kernel.reshape(before, before, -1)
    resized = ops.convert_to_numpy(ops.image.resize(maps, (now, now), antialias=True))
    return (resized * (before / now) ** 2).reshape(-1, kernel.shape[1])
