"""TensorBoard logs of a stage: losses, measures, gradient norms, throughput and pictures.

The event files are written through TensorBoard's own package, which does not need TensorFlow.
"""

import importlib.util
import io
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import keras
import numpy as np

from lime_keras.io import atomic
from lime_keras.outputs import OUTPUTS

from . import terms
from .stage_model import StageModel

_PANELS = 4
"""Number of held-out examples in a picture."""
_LAYERS = tuple(name for name, output in OUTPUTS.items() if output.layer)


class Board:
    """The event file of one stage, which `tensorboard --logdir RUN` shows.

    Without the package tensorboard nothing is written: a run's curves do not need it.

    Args:
        folder: folder of the stage's event files; each `Board` adds one. None to write nothing.
    """

    def __init__(self, folder: Path | None):
        self._writer: Any = None
        if folder is None or not installed():
            return
        from tensorboard.compat.proto import event_pb2
        from tensorboard.summary.writer.record_writer import RecordWriter

        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"events.out.tfevents.{time.time():.6f}.{socket.gethostname()}"
        self._writer, self._path = RecordWriter(path.open("wb")), path
        version = event_pb2.Event(wall_time=time.time(), file_version="brain.Event:2")
        self._put(version)

    def scalars(self, step: int, groups: Mapping[str, Mapping[str, float]]) -> None:
        """Write numbers under the names `group/name`."""
        if self._writer is None:
            return
        from tensorboard.plugins.scalar.summary_v2 import scalar_pb

        for group, values in groups.items():
            for name, value in values.items():
                self._add(step, scalar_pb(f"{group}/{name}", value))

    def panel(self, step: int, model: StageModel, batch: Mapping[str, Any]) -> None:
        """Write a picture of the stage's predictions for the first examples of a batch."""
        if self._writer is None:
            return
        from PIL import Image
        from tensorboard.compat.proto import summary_pb2
        from tensorboard.plugins.image.metadata import create_summary_metadata
        from tensorboard.util.tensor_util import make_tensor_proto

        drawn, png = Image.fromarray(picture(model, batch)), io.BytesIO()
        drawn.save(png, "PNG")
        width, height = (str(pixels).encode() for pixels in drawn.size)
        summary = summary_pb2.Summary()
        summary.value.add(
            tag="held out",
            tensor=make_tensor_proto([width, height, png.getvalue()]),
            metadata=create_summary_metadata(None, None),
        )
        self._add(step, summary)

    def close(self) -> None:
        """Finish the event file."""
        if self._writer is not None:
            with atomic.naming_writer(self._path):
                self._writer.close()

    def _add(self, step: int, summary: Any) -> None:
        from tensorboard.compat.proto import event_pb2

        event = event_pb2.Event(wall_time=time.time(), step=step, summary=summary)
        self._put(event)

    def _put(self, event: Any) -> None:
        with atomic.naming_writer(self._path):
            self._writer.write(event.SerializeToString())
            self._writer.flush()


def installed() -> bool:
    """Return whether the package is there that event files are written through."""
    return importlib.util.find_spec("tensorboard") is not None


def picture(model: StageModel, batch: Mapping[str, Any]) -> np.ndarray:
    """Return the picture (`panel`) of a stage's predictions for the first examples of a batch."""
    first = {name: value[:_PANELS] for name, value in batch.items()}
    return panel(first, model(first).outputs)


def panel(batch: Mapping[str, Any], outputs: Mapping[str, Any]) -> np.ndarray:
    """Return a picture with a row for each example.

    A row shows the image, then truth and prediction of each layer side by side.

    Args:
        batch: batch of the pipeline.
        outputs: predicted outputs for the batch, as the assembled system would have them
            (`StageAnswer.outputs`).

    Returns:
        `(B·S, K·S, 3)` uint8. Radiance is compressed. White is the maximum of the true layer.
        Values that are not finite are magenta.
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
    """Return the values of a layer as they are shown: 0 is black, and radiance is compressed."""
    values, levels = keras.ops.convert_to_numpy(layer), OUTPUTS[name].levels
    if levels is None:
        return np.log1p(values)
    low, high = levels
    return (values - low) / (high - low)
