"""TensorBoard logs of a stage: losses, measures, gradient norms and throughput.

The event files are written through TensorBoard's own package, which does not need TensorFlow.
"""

import importlib.util
import socket
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lime_keras.io import atomic


class Board:
    """The event file of one stage, which `tensorboard --logdir RUN` shows.

    Without the package tensorboard nothing is written: a run's curves do not need it.

    Args:
        folder: folder of the stage's event files; each `Board` adds one. None to write nothing.
    """

    def __init__(self, folder: Path | None):
        self._writer: Any = None
        if folder is None or importlib.util.find_spec("tensorboard") is None:
            return
        from tensorboard.summary.writer.record_writer import RecordWriter

        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"events.out.tfevents.{time.time():.6f}.{socket.gethostname()}"
        self._writer, self._path = RecordWriter(path.open("wb")), path
        self._put(file_version="brain.Event:2")

    def scalars(self, step: int, groups: Mapping[str, Mapping[str, float]]) -> None:
        """Write numbers under the names `group/name`."""
        if self._writer is None:
            return
        from tensorboard.plugins.scalar.summary_v2 import scalar_pb

        for group, values in groups.items():
            for name, value in values.items():
                self._put(step=step, summary=scalar_pb(f"{group}/{name}", value))

    def close(self) -> None:
        """Finish the event file."""
        if self._writer is not None:
            with atomic.naming_writer(self._path):
                self._writer.close()

    def _put(self, **content: Any) -> None:
        from tensorboard.compat.proto import event_pb2

        event = event_pb2.Event(wall_time=time.time(), **content)
        with atomic.naming_writer(self._path):
            self._writer.write(event.SerializeToString())
            self._writer.flush()
