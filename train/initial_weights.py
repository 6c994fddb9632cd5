"""The weights of a trained model that a run begins with, in place of fresh weights."""

from collections.abc import Collection
from pathlib import Path

import keras
import numpy as np
from keras import ops

from lime_keras.model import weights
from lime_keras.networks.architecture import ENCODER_BLOCKS
from lime_keras.networks.registry import is_plain
from lime_keras.networks.wiring import Networks


def load(model: Path | None, subnetworks: Networks, fresh: Collection[str] = ()) -> list[str]:
    """Set the weights of those subnetworks that have the same layers in a trained model.

    Those of `fresh` keep their own.

    A U-Net's layers are the same for any image size. An encoder's first dense layer depends on it:
    if the trained model sees images of another size, its kernel is resampled.

    Returns:
        Names of the subnetworks that were set.

    Raises:
        FileNotFoundError: if no model is given, or the folder holds none.
        ValueError: if no subnetwork fits, one of `fresh` is none, or a file is broken.
    """
    if unknown := sorted(set(fresh) - set(subnetworks)):
        raise ValueError(f"--fresh {' '.join(unknown)}: this run has {', '.join(subnetworks)}")
    if model is None:
        raise FileNotFoundError("this run began with another model: pass its --start-from again")
    _, others = weights.load(model, whole=False)
    fitting = {
        name: values
        for name, network in subnetworks.items()
        if name in set(others) - set(fresh) and (values := _fit(network, others[name])) is not None
    }
    if not fitting:
        raise ValueError(
            f"none of the subnetworks in {model} has the layers of this run's, or all are --fresh: "
            "leave out --start-from, or pass the --width and --preset that it was trained with"
        )
    for name, values in fitting.items():
        subnetworks[name].set_weights(values)
    return list(fitting)


def _fit(network: keras.Model, other: keras.Model) -> list[np.ndarray] | None:
    """Return the weights of another network for this one, or None if its layers differ."""
    cells, before = (one.inputs[0].shape[1] // 2**ENCODER_BLOCKS for one in (network, other))
    values = other.get_weights()
    # An input of another name is in another unit.
    read, read_before = ([one.name for one in net.inputs] for net in (network, other))
    units_differ = read != read_before or is_plain(network) != is_plain(other)
    if len(values) != len(network.weights) or units_differ:
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
