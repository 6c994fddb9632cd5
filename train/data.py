"""The training batches of a stage, and the held-out batches that it is evaluated on."""

import functools
import math
import zlib
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import keras

from lime_keras.data import pipeline

from .config import Config
from .stages import Stage

_ORIGIN = ("seed", "index")
"""Features that identify an example of a corpus."""

Batch = dict[str, Any]


class Data:
    """The train splits of corpora, with the last tenth of each split's files held out.

    Args:
        corpora: folders with complete train splits.
        config: config of the run.

    Raises:
        FileNotFoundError: if a split is incomplete.
        ValueError: if a split is too small or damaged.
    """

    def __init__(self, corpora: Sequence[Path], config: Config):
        training, self._held_out = zip(*map(pipeline.training_shards, corpora), strict=True)
        self._training = [path for shards in training for path in shards]
        self._config = config

    def training(self, stage: Stage, features: Collection[str], first_step: int) -> Iterator[Batch]:
        """Yield a stage's batches without end, from a step on.

        Each batch also holds `seed` and `index`, which identify its examples.
        """
        config = self._config
        dataset = pipeline.training(
            self._training,
            size=config.architecture.size,
            batch_size=config.schedule.batch_size,
            seed=zlib.crc32(f"{config.seed} {stage.name}".encode()),
            first_step=first_step,
            camera=config.camera,
            flips=config.schedule.flips,
            repaints=config.schedule.repaints,
            features=(*features, *_ORIGIN),
        )
        for batch in pipeline.naming_damage(dataset, self._training):
            yield _native(batch)

    def held_out(self, features: Collection[str]) -> "HeldOut":
        """Return the held-out examples: equally many of each corpus, where it has enough."""
        config = self._config
        share = config.schedule.validation_examples / len(self._held_out)
        count = math.ceil(share / config.schedule.batch_size)
        datasets = [
            pipeline.evaluation(
                shards,
                size=config.architecture.size,
                batch_size=config.schedule.batch_size,
                camera=config.camera,
                features=features,
            ).take(count)
            for shards in self._held_out
        ]
        dataset = functools.reduce(lambda one, other: one.concatenate(other), datasets)
        return HeldOut(dataset.cache(), [path for shards in self._held_out for path in shards])


class HeldOut:
    """Held-out batches, which are read once and can be iterated many times."""

    def __init__(self, dataset: Any, shards: list[Path]):
        self._dataset, self._shards = dataset, shards

    def __iter__(self) -> Iterator[Batch]:
        """Yield the batches, from the first."""
        for batch in pipeline.naming_damage(self._dataset, self._shards):
            yield _native(batch)


def without_origin(batch: Batch) -> Batch:
    """Return a batch without `seed` and `index`, which the networks must not get."""
    return {name: value for name, value in batch.items() if name not in _ORIGIN}


def origin(batch: Batch, row: int) -> str:
    """Return words that identify the example in a row of a batch."""
    seed, index = (int(batch[name][row]) for name in _ORIGIN)
    return f"example {index} of seed {seed}"


def _native(batch: Batch) -> Batch:
    """Return the batch with NumPy arrays in place of tensors, unless TensorFlow is the backend."""
    if keras.backend.backend() == "tensorflow":
        return batch
    return {name: value.numpy() for name, value in batch.items()}
