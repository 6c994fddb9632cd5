"""One batch split between several devices, through TensorFlow's or Keras' own means."""

import contextlib
from collections.abc import Mapping
from typing import Any

import keras
import numpy as np


class Devices:
    """The first `count` accelerators, or, where there is none, processors.

    Under TensorFlow each device holds a copy of the weights (`tf.distribute.MirroredStrategy`);
    under JAX Keras lays the batch out (`keras.distribution.DataParallel`).

    Args:
        count: of devices; 1 leaves everything where the backend puts it.

    Raises:
        ValueError: if there are fewer.
    """

    def __init__(self, count: int):
        self.count = count
        self._strategy: Any = None
        if keras.backend.backend() != "tensorflow":
            # Keras keeps it for the whole process: an earlier one must not stay.
            keras.distribution.set_distribution(_parallel(count) if count > 1 else None)
        elif count > 1:
            self._strategy = _mirrored(count)

    @property
    def replicas(self) -> int:
        """How many of the devices see a part of the batch as if it were a whole one."""
        return 1 if self._strategy is None else self.count

    def scope(self) -> contextlib.AbstractContextManager:
        """What weights and optimisers are made in."""
        return contextlib.nullcontext() if self._strategy is None else self._strategy.scope()

    def split(self, batch: Mapping[str, Any]) -> Any:
        """The batch as Keras takes it; one that cannot be shared out is seen whole by each."""
        size = len(next(iter(batch.values())))
        if self._strategy is None:
            if not size % self.count:
                return batch
            # Keras deals out the rows itself, but only evenly. The means over several copies of a
            # batch are its own.
            return {name: np.concatenate([value] * self.count) for name, value in batch.items()}
        if size % self.count:
            return batch
        part = size // self.count

        def share(context: Any) -> dict[str, Any]:
            start = context.replica_id_in_sync_group * part
            return {name: value[start : start + part] for name, value in batch.items()}

        return self._strategy.experimental_distribute_values_from_function(share)

    def weights(self, batch: Mapping[str, Any]) -> Any:
        """What each example counts in sums over all devices, split as the batch is.

        A batch that each device sees whole would else count that many times.
        """
        size = len(next(iter(batch.values())))
        counted = 1 / self.count if size % self.count else 1.0
        return self.split({"weights": keras.ops.full((size,), counted)})["weights"]


def _mirrored(count: int) -> Any:
    import tensorflow as tf

    names = [device.name for device in tf.config.list_logical_devices("GPU")] or [
        device.name for device in tf.config.list_logical_devices("CPU")
    ]
    return tf.distribute.MirroredStrategy(_first(names, count))


def _parallel(count: int) -> keras.distribution.DataParallel:
    names = _first(keras.distribution.list_devices(), count)
    return keras.distribution.DataParallel(devices=names)


def _first(names: list[str], count: int) -> list[str]:
    if len(names) < count:
        raise ValueError(
            f"--devices {count}, but {keras.backend.backend()} sees {len(names)}: "
            f"{', '.join(names)}"
        )
    return names[:count]
