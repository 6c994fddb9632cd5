"""The batches that stages learn from, and the held-out ones that they are judged by."""

import math
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import keras

from lime_keras import pipeline

from .config import Config
from .stages import Stage

_ORIGIN = ("seed", "index")
"""What names an example."""

Batch = dict[str, Any]


class Data:
    """A corpus' train split, the last tenth of its files held out.

    Args:
        corpus: folder with a complete train split.
        config: of the run.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if it is too small or damaged.
    """

    def __init__(self, corpus: Path, config: Config):
        self._training, self._held_out = pipeline.training_shards(corpus)
        self._config = config

    def training(self, stage: Stage, features: Collection[str], first_step: int) -> Iterator[Batch]:
        """Endless batches for a stage, from a step on; with `seed` and `index` of each example."""
        config = self._config
        dataset = pipeline.training(
            self._training,
            size=config.architecture.size,
            batch_size=config.schedule.batch_size,
            seed=zlib.crc32(f"{config.seed} {stage.name}".encode()),
            first_step=first_step,
            camera=config.camera,
            features=(*features, *_ORIGIN),
        )
        for batch in pipeline.naming_damage(dataset, self._training):
            yield _native(batch)

    def held_out(self, features: Collection[str]) -> "HeldOut":
        """The examples that a stage is judged by."""
        config = self._config
        dataset = pipeline.evaluation(
            self._held_out,
            size=config.architecture.size,
            batch_size=config.schedule.batch_size,
            camera=config.camera,
            features=features,
        )
        count = math.ceil(config.schedule.validation_examples / config.schedule.batch_size)
        return HeldOut(dataset.take(count).cache(), self._held_out)


class HeldOut:
    """Batches that can be gone through again and again; read once."""

    def __init__(self, dataset: Any, shards: list[Path]):
        self._dataset, self._shards = dataset, shards

    def __iter__(self) -> Iterator[Batch]:
        """From the first one on."""
        for batch in pipeline.naming_damage(self._dataset, self._shards):
            yield _native(batch)


def without_origin(batch: Batch) -> Batch:
    """What the networks may be given of a batch."""
    return {name: value for name, value in batch.items() if name not in _ORIGIN}


def origin(batch: Batch, row: int) -> str:
    """Which example of the corpus a row of a batch is."""
    seed, index = (int(batch[name][row]) for name in _ORIGIN)
    return f"example {index} of seed {seed}"


def _native(batch: Batch) -> Batch:
    """As the backend takes it: other backends than TensorFlow know NumPy's arrays."""
    if keras.backend.backend() == "tensorflow":
        return batch
    return {name: value.numpy() for name, value in batch.items()}
