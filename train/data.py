"""The training batches of a stage, and the held-out batches that it is evaluated on.

They come from corpora of stored records, from banks of geometry whose scenes are made where the
training runs, or from both. TensorFlow is imported only to read records.
"""

import functools
import itertools
import math
import zlib
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import keras
import numpy as np

from lime_keras.data import clutter, prints
from lime_keras.data.corpus import Split
from lime_keras.data.cutouts import Cutouts
from lime_keras.synthesis import bank

from .config import Config, is_bank
from .sources import masks
from .stages import Stage

_ORIGIN = ("seed", "index")
"""Features that identify an example: in a corpus its own, of a bank's scene seed and position."""
_ALWAYS = ("shininess",)
"""Features that held-out batches always hold, so that all stages can share them."""

SEEN_MASK = "seen_mask"
"""Feature: the mask that the object is cut out with; losses and measures take the true one."""

Batch = dict[str, Any]


class Data:
    """The training and held-out batches of a run.

    Batches of corpora and of banks alternate in proportion to the number of paths of each kind: of
    two corpora and a bank, every third batch is the bank's. Each batch is of one kind, and mixes
    all paths of its kind.

    Args:
        paths: folders of corpora with complete train splits, and of complete banks.
        config: config of the run.
        rows: (k, n): the training batches hold only the k-th of n equal parts of each batch.
        photographs: folders of things and places whose hash is `config.cutouts`.

    Raises:
        FileNotFoundError: if a split or a bank is incomplete, or the cut-outs' folders are not
            given.
        ValueError: if a split is too small, or if anything is damaged or of an image size that does
            not fit.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        config: Config,
        rows: tuple[int, int] = (0, 1),
        photographs: tuple[Path, Path] | None = None,
    ):
        banks = [path for path in paths if is_bank(path)]
        corpora = [path for path in paths if path not in banks]
        self._paths, self._bank_count, self._config = paths, len(banks), config
        self._part = rows[0]
        self._corpora: Any = None
        self._banks: Any = None
        if corpora:
            from .sources.corpora import Corpora

            self._corpora = Corpora(corpora, config, rows)
        if banks:
            from .sources.banks import Banks

            self._banks = Banks(banks, config, rows)
        _check_sizes(paths, config.architecture.size)
        if config.cutouts is not None and photographs is None:
            raise FileNotFoundError("this run learns from cut-outs: pass its --cutouts again")
        self._photographs = photographs
        self._masker: keras.Model | None = None
        self._kept: list[Batch] = []
        self._kept_features: set[str] = set()

    def training(self, stage: Stage, features: Collection[str], first_step: int) -> Iterator[Batch]:
        """Yield a stage's batches without end, from a step on.

        Each batch also holds `seed` and `index`, which identify its examples. The feature
        `seen_mask` is made here (`train.sources.masks`).
        """
        sees, features = SEEN_MASK in features, [name for name in features if name != SEEN_MASK]
        seed = zlib.crc32(f"{self._config.seed} {stage.name}".encode())
        of_banks = self._steps_of_banks(first_step)
        wanted, batches = (*features, *_ORIGIN), {}
        if self._banks is not None:
            batches["banks"] = self._banks.training(seed, wanted, of_banks)
        if self._corpora is not None:
            batches["corpora"] = self._corpora.training(seed, wanted, first_step - of_banks)
        is_of_masks = stage.subnetworks == ("segmentation",)
        cutouts = self._cutouts if is_of_masks else None
        for step in itertools.count(first_step):
            batch = next(batches["banks" if self._is_of_banks(step) else "corpora"])
            generator = np.random.default_rng((seed, step, self._part))
            if not self._config.schedule.papers:
                image = (
                    clutter.add(batch["image"], batch["mask"], generator)
                    if is_of_masks
                    else prints.add(batch, generator)
                )
                batch = batch | {"image": image}
            if cutouts is not None:
                images, covers = cutouts.put(batch["image"], batch["mask"], generator)
                batch = batch | {"image": images, "mask": covers}
            if sees:
                seen = masks.seen(self._masker, batch["image"], batch["mask"], generator)
                batch = batch | {SEEN_MASK: seen}
            yield batch

    def cut_out_by(self, masker: keras.Model | None) -> None:
        """Let `seen_mask` be what a SegmentationNet finds, in some images; None lets it be true."""
        self._masker = masker
        for batch in self._kept:
            batch.pop(SEEN_MASK, None)

    def seen(self, stage: Stage, features: Collection[str]) -> tuple[str, ...]:
        """Return a stage's features, with `seen_mask` if it learns on masks that are not true."""
        sees = not (self._config.schedule.papers or "segmentation" in stage.subnetworks)
        return (*features, *([SEEN_MASK] if sees else []))

    def held_out(self, features: Collection[str]) -> Iterator[Batch]:
        """Yield the held-out batches: equally many of each path, where it has enough.

        They are read or made once, and then kept in memory. `seen_mask` is that of
        `cut_out_by`'s network, or the true one if there is none.
        """
        sees, features = SEEN_MASK in features, [name for name in features if name != SEEN_MASK]
        if not self._kept_features.issuperset(features):
            self._kept_features |= {*features, *_ALWAYS}
            self._kept = list(self._held_out(sorted(self._kept_features)))
        for batch in self._kept:
            if sees and SEEN_MASK not in batch:
                batch[SEEN_MASK] = (
                    batch["mask"]
                    if self._masker is None
                    else masks.own(self._masker, batch["image"])
                )
            names = [*features, SEEN_MASK] if sees else features
            yield {name: batch[name] for name in names}

    def blamed(self, step: int, batch: Batch, rows: Sequence[int]) -> str:
        """Return words that identify examples of a batch and say what mends them.

        Args:
            step: number of batches before this one.
            batch: batch of `training`.
            rows: rows of the examples, at least one.
        """
        origins = [(int(batch["seed"][row]), int(batch["index"][row])) for row in rows]
        of_banks = self._steps_of_banks(step)
        if self._is_of_banks(step):
            return self._banks.blamed(of_banks, origins)
        return self._corpora.blamed(step - of_banks, origins)

    @functools.cached_property
    def _cutouts(self) -> Cutouts | None:
        if self._photographs is None:
            return None
        return Cutouts(*self._photographs, self._config.architecture.size)

    def _held_out(self, features: Collection[str]) -> Iterator[Batch]:
        share = self._config.schedule.validation_examples / len(self._paths)
        batches = math.ceil(share / self._config.schedule.batch_size)
        for source in filter(None, (self._corpora, self._banks)):
            yield from source.held_out(features, batches)

    def _steps_of_banks(self, steps: int) -> int:
        """Return how many of the first `steps` batches are of banks."""
        return steps * self._bank_count // len(self._paths)

    def _is_of_banks(self, step: int) -> bool:
        return self._steps_of_banks(step + 1) > self._steps_of_banks(step)


def without_origin(batch: Batch) -> Batch:
    """Return a batch without `seed` and `index`, which the networks must not get."""
    return {name: value for name, value in batch.items() if name not in _ORIGIN}


def _check_sizes(paths: Sequence[Path], size: int) -> None:
    """Raise ValueError if images cannot be averaged down to the networks' size."""
    for path in paths:
        stored = _size(path) or size
        if stored % size:
            raise ValueError(
                f"{path} holds images of {stored} pixels, which cannot be averaged to the {size} "
                f"that the networks take: pass --size with a divisor of {stored}, or render with "
                f"--size {size} or a multiple of it"
            )


def _size(path: Path) -> int | None:
    return bank.manifest(path)["size"] if is_bank(path) else Split(path, "train").size
