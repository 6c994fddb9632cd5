"""Data-parallel training: one batch split between several devices, under TensorFlow or JAX.

Under JAX the devices may belong to several processes (`train.hosts`).
"""

import contextlib
from collections.abc import Iterator, Mapping
from typing import Any

import keras
import numpy as np

from . import hosts


class Devices:
    """The first `count` accelerators of each process or, where there are none, processors.

    Under TensorFlow each device holds a copy of the weights (`tf.distribute.MirroredStrategy`).
    Under JAX, Keras distributes the batch (`keras.distribution.DataParallel`).

    Attributes:
        count: number of devices of each process.
        process: number of this process, from 0.
        processes: number of processes.

    Args:
        count: number of devices of each process; with 1, the backend chooses the device.

    Raises:
        ValueError: if there are fewer devices.
    """

    def __init__(self, count: int):
        self.count = count
        self.process, self.processes = hosts.rank_and_size()
        self._all = count * self.processes
        self._strategy: Any = None
        if keras.backend.backend() != "tensorflow":
            # Keras keeps a distribution for the whole process: an earlier one must not stay.
            keras.distribution.set_distribution(_parallel(count) if self._all > 1 else None)
        elif count > 1:
            self._strategy = _mirrored(count)

    @property
    def replicas(self) -> int:
        """The number of devices that each treat their part of the batch as a whole batch."""
        return 1 if self._strategy is None else self.count

    def scope(self) -> contextlib.AbstractContextManager:
        """Return the context in which weights and optimisers must be created."""
        return contextlib.nullcontext() if self._strategy is None else self._strategy.scope()

    @property
    def leads(self) -> bool:
        """True in the process that writes files."""
        return self.process == 0

    @contextlib.contextmanager
    def without_distribution(self) -> Iterator[None]:
        """Return the context in which this process may create variables without the others."""
        if keras.backend.backend() == "tensorflow":
            yield
            return
        distribution = keras.distribution.distribution()
        keras.distribution.set_distribution(None)
        try:
            yield
        finally:
            keras.distribution.set_distribution(distribution)

    def local_copies(self, networks: Mapping[str, keras.Model]) -> dict[str, keras.Model]:
        """Return networks that this process may run without the others."""
        if self.processes == 1:
            return dict(networks)
        with self.without_distribution():
            copies = {name: keras.models.clone_model(one) for name, one in networks.items()}
            for name, copy in copies.items():
                copy.set_weights(networks[name].get_weights())
        return copies

    def split(self, batch: Mapping[str, Any]) -> Any:
        """Return this process's part of a batch that all have, split between its devices for Keras.

        If the examples cannot be split evenly, each device gets all of them.
        """
        size = len(next(iter(batch.values())))
        is_even = size % self._all == 0
        if self._strategy is None:
            if not is_even:
                # Keras splits the rows itself, but only evenly. Several copies of the batch can be
                # split evenly, and their means are those of the batch.
                return {name: np.concatenate([value] * self.count) for name, value in batch.items()}
            share = size // self.processes
            rows = slice(share * self.process, share * (self.process + 1))
            return {name: value[rows] for name, value in batch.items()}
        if not is_even:
            return batch
        part = size // self.count

        def of_device(context: Any) -> dict[str, Any]:
            start = context.replica_id_in_sync_group * part
            return {name: value[start : start + part] for name, value in batch.items()}

        return self._strategy.experimental_distribute_values_from_function(of_device)

    def weights(self, batch: Mapping[str, Any]) -> Any:
        """Return the weight of each example in sums over all devices, split like the batch.

        Of n devices that all get an example, each weighs it with 1 / n, so that it counts once.
        """
        size = len(next(iter(batch.values())))
        counted = 1 / self._all if size % self._all else 1.0
        return self.split({"weights": keras.ops.full((size,), counted)})["weights"]


def _mirrored(count: int) -> Any:
    import tensorflow as tf

    devices = tf.config.list_logical_devices("GPU") or tf.config.list_logical_devices("CPU")
    return tf.distribute.MirroredStrategy(_first([device.name for device in devices], count))


def _parallel(count: int) -> keras.distribution.DataParallel:
    import jax

    by_process: dict[int, list[str]] = {}
    for device in jax.devices():
        by_process.setdefault(device.process_index, []).append(f"{device.platform}:{device.id}")
    names = [name for process in sorted(by_process) for name in _first(by_process[process], count)]
    # Each process makes its own part of a batch.
    return keras.distribution.DataParallel(devices=names, auto_shard_dataset=False)


def _first(names: list[str], count: int) -> list[str]:
    if len(names) < count:
        raise ValueError(
            f"--devices {count}, but {keras.backend.backend()} sees {len(names)}: "
            f"{', '.join(names)}"
        )
    return names[:count]
