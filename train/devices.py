"""Data-parallel training: one batch split between several devices, under TensorFlow or JAX."""

import contextlib
from collections.abc import Mapping
from typing import Any

import keras
import numpy as np


class Devices:
    """The first `count` accelerators or, where there are none, processors.

    Under TensorFlow each device holds a copy of the weights (`tf.distribute.MirroredStrategy`).
    Under JAX, Keras distributes the batch (`keras.distribution.DataParallel`).

    Args:
        count: number of devices; with 1, the backend chooses the device.

    Raises:
        ValueError: if there are fewer devices.
    """

    def __init__(self, count: int):
        self.count = count
        self._strategy: Any = None
        if keras.backend.backend() != "tensorflow":
            # Keras keeps a distribution for the whole process: an earlier one must not stay.
            keras.distribution.set_distribution(_parallel(count) if count > 1 else None)
        elif count > 1:
            self._strategy = _mirrored(count)

    @property
    def replicas(self) -> int:
        """The number of devices that each treat their part of the batch as a whole batch."""
        return 1 if self._strategy is None else self.count

    def scope(self) -> contextlib.AbstractContextManager:
        """Return the context in which weights and optimisers must be created."""
        return contextlib.nullcontext() if self._strategy is None else self._strategy.scope()

    def split(self, batch: Mapping[str, Any]) -> Any:
        """Return the batch in the form that Keras takes, split between the devices.

        If its examples cannot be split evenly, each device gets the whole batch.
        """
        size = len(next(iter(batch.values())))
        if self._strategy is None:
            if not size % self.count:
                return batch
            # Keras splits the rows itself, but only evenly. Several copies of the batch can be
            # split evenly, and their means are those of the batch.
            return {name: np.concatenate([value] * self.count) for name, value in batch.items()}
        if size % self.count:
            return batch
        part = size // self.count

        def share(context: Any) -> dict[str, Any]:
            start = context.replica_id_in_sync_group * part
            return {name: value[start : start + part] for name, value in batch.items()}

        return self._strategy.experimental_distribute_values_from_function(share)

    def weights(self, batch: Mapping[str, Any]) -> Any:
        """Return the weight of each example in sums over all devices, split like the batch.

        An example that every device gets has the weight 1 / `count`, so that it counts once.
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
