"""Data-parallel training under JAX: one batch split between several devices, also of several hosts.

Keras distributes the batch (`keras.distribution.DataParallel`). The devices may belong to several
processes (`train.hosts`). Under TensorFlow there is one device, which TensorFlow chooses.
"""

import contextlib
from collections.abc import Iterator, Mapping
from typing import Any

import keras
import numpy as np

from . import hosts


class Devices:
    """The first `count` accelerators of each process or, where there are none, processors.

    Attributes:
        count: number of devices of each process.
        process: number of this process, from 0.
        processes: number of processes.

    Args:
        count: number of devices of each process; with 1, the backend chooses the device.

    Raises:
        ValueError: if there are fewer devices, or several under another backend than JAX.
    """

    def __init__(self, count: int):
        self.count = count
        self.process, self.processes = hosts.rank_and_size()
        self._all = count * self.processes
        if keras.backend.backend() == "jax":
            # Keras keeps a distribution for the whole process: an earlier one must not stay.
            keras.distribution.set_distribution(_parallel(count) if self._all > 1 else None)
        elif count > 1:
            raise ValueError(
                f"--devices {count} needs JAX, and Keras runs on {keras.backend.backend()}: set "
                "KERAS_BACKEND=jax (pip install 'jax[cuda12]')"
            )

    @property
    def leads(self) -> bool:
        """True in the process that writes files."""
        return self.process == 0

    @contextlib.contextmanager
    def without_distribution(self) -> Iterator[None]:
        """Return the context in which this process may create variables without the others."""
        if keras.backend.backend() != "jax":
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

    def share(self, batch: Mapping[str, Any]) -> dict[str, Any]:
        """Return this process's examples of a batch that every process has.

        If its examples cannot be split evenly, each device gets the whole batch: Keras splits the
        rows between the devices itself, but only evenly, and means stay those of the batch.
        """
        size = len(next(iter(batch.values())))
        if size % self._all:
            return {name: np.concatenate([value] * self.count) for name, value in batch.items()}
        part = size // self.processes
        rows = slice(part * self.process, part * (self.process + 1))
        return {name: value[rows] for name, value in batch.items()}

    def weights(self, batch: Mapping[str, Any]) -> np.ndarray:
        """Return the weight of each example of `share` in sums over all devices.

        Of n devices that all get an example, each weighs it with 1 / n, so that it counts once.

        Args:
            batch: batch that every process has.
        """
        size = len(next(iter(batch.values())))
        counted = 1 / self._all if size % self._all else 1.0
        return self.share({"weights": np.full(size, counted, np.float32)})["weights"]


def _parallel(count: int) -> keras.distribution.DataParallel:
    import jax

    by_process: dict[int, list[str]] = {}
    for device in jax.devices():
        by_process.setdefault(device.process_index, []).append(f"{device.platform}:{device.id}")
    for names in by_process.values():
        if len(names) < count:
            raise ValueError(f"--devices {count}, but JAX sees {len(names)}: {', '.join(names)}")
    chosen = [name for process in sorted(by_process) for name in by_process[process][:count]]
    # Each process makes its own part of a batch.
    return keras.distribution.DataParallel(devices=chosen, auto_shard_dataset=False)
