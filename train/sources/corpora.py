"""The training batches of corpora's records, read by TensorFlow whatever the backend."""

import itertools
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import keras

from lime_keras.data import pipeline
from lime_keras.optics.material_law import UNIFORM

from ..config import Config

Batch = dict[str, Any]


class Corpora:
    """The train splits of corpora, with the last tenth of each split's files held out.

    Args:
        folders: folders with complete train splits.
        config: config of the run.
        rows: (k, n): the training batches hold only the k-th of n equal parts of each batch. All
            of it is read, though.

    Raises:
        FileNotFoundError: if a split is incomplete.
        ValueError: if a split is too small or damaged.
    """

    def __init__(self, folders: Sequence[Path], config: Config, rows: tuple[int, int]):
        training, self._held_out = zip(*map(pipeline.training_shards, folders), strict=True)
        self._training = [path for shards in training for path in shards]
        part, parts = rows
        share = config.schedule.batch_size // parts
        self._config, self._rows = config, slice(part * share, (part + 1) * share)

    def training(self, seed: int, features: Collection[str], first_step: int) -> Iterator[Batch]:
        """Yield batches without end, from a step on; the seed determines them."""
        config = self._config
        dataset = pipeline.training(
            self._training,
            size=config.architecture.size,
            batch_size=config.schedule.batch_size,
            seed=seed,
            first_step=first_step,
            camera=config.schedule.camera,
            flips=config.schedule.flips,
            repaints=config.schedule.repaints,
            materials=config.materials or (UNIFORM,),
            features=features,
        )
        for batch in pipeline.naming_damage(dataset, self._training):
            yield {name: value[self._rows] for name, value in _native(batch).items()}

    def held_out(self, features: Collection[str], batches: int) -> Iterator[Batch]:
        """Yield so many held-out batches of each corpus, or fewer where it has no more."""
        config = self._config
        for shards in self._held_out:
            dataset = pipeline.evaluation(
                shards,
                size=config.architecture.size,
                batch_size=config.schedule.batch_size,
                camera=config.schedule.camera,
                repaints=config.materials is not None,
                materials=config.materials or (UNIFORM,),
                features=features,
            )
            found = pipeline.naming_damage(dataset, shards)
            yield from map(_native, itertools.islice(found, batches))

    def blamed(self, origins: Sequence[tuple[int, int]]) -> str:
        """Return words for examples of these seeds and indices, and what mends them."""
        named = ", ".join(f"example {index} of seed {seed}" for seed, index in origins)
        return f"{named} of the train split: render it again, or leave it out"


def _native(batch: Batch) -> Batch:
    """Return the batch with NumPy arrays in place of tensors, unless TensorFlow is the backend."""
    if keras.backend.backend() == "tensorflow":
        return batch
    return {name: value.numpy() for name, value in batch.items()}
