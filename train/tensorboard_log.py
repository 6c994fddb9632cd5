"""TensorBoard logs of a stage: losses, gradient norms, throughput, and what the networks see."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import keras
import numpy as np
import tensorflow as tf

from lime_keras.outputs import OUTPUTS

from . import terms
from .stage_model import StageModel

_PANELS = 4
"""Held-out examples shown."""
_LAYERS = tuple(name for name, output in OUTPUTS.items() if output.layer)


class Board:
    """Event files in one folder, `tensorboard --logdir RUN` shows them."""

    def __init__(self, folder: Path):
        self._writer = tf.summary.create_file_writer(str(folder))

    def scalars(self, step: int, groups: Mapping[str, Mapping[str, float]]) -> None:
        """Write numbers, named `group/name`."""
        with self._writer.as_default(step):
            for group, values in groups.items():
                for name, value in values.items():
                    tf.summary.scalar(f"{group}/{name}", value)
        self._writer.flush()

    def panel(self, step: int, model: StageModel, batch: Mapping[str, Any]) -> None:
        """Write a picture of what the stage answers for the first held-out examples."""
        first = {name: value[:_PANELS] for name, value in batch.items()}
        with self._writer.as_default(step):
            tf.summary.image("held out", panel(first, model(first).outputs)[None])
        self._writer.flush()

    def close(self) -> None:
        """Finish the event file."""
        self._writer.close()


def panel(batch: Mapping[str, Any], outputs: Mapping[str, Any]) -> np.ndarray:
    """One row per example: its image, then truth and answer of each layer side by side.

    Args:
        batch: of the pipeline.
        outputs: of an `Answer`.

    Returns:
        `(B·S, K·S, 3)` uint8. Radiance is compressed, and each row is shown up to the truth's
        maximum; what is not finite is magenta.
    """
    image = keras.ops.convert_to_numpy(batch["image"])
    mask = keras.ops.convert_to_numpy(batch["mask"])
    columns = [image]
    for name in filter(outputs.__contains__, _LAYERS):
        true = _levels(name, terms.truth(name, batch))
        if OUTPUTS[name].layer == "photo" and name != "mask":
            true = true * mask
        white = np.maximum(np.max(true, axis=(1, 2, 3), keepdims=True), 1e-6)
        columns += [true / white, _levels(name, outputs[name]) / white]
    coloured = [np.broadcast_to(column, image.shape) for column in columns]
    picture = np.concatenate([np.concatenate(list(column)) for column in coloured], axis=1)
    broken = ~np.isfinite(picture).all(axis=-1)
    eight_bit = np.rint(np.clip(np.nan_to_num(picture), 0, 1) * 255).astype(np.uint8)
    eight_bit[broken] = (255, 0, 255)
    return eight_bit


def _levels(name: str, layer: Any) -> np.ndarray:
    """A layer's values as shown, from 0."""
    values, levels = keras.ops.convert_to_numpy(layer), OUTPUTS[name].levels
    if levels is None:
        return np.log1p(values)
    low, high = levels
    return (values - low) / (high - low)
