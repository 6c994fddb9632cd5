"""The training batches of a stage, and the held-out batches that it is evaluated on.

They come from corpora of stored records, which TensorFlow reads whatever the backend.
"""

import functools
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

from .config import Config
from .sources import masks
from .sources.corpora import Corpora
from .stages import Stage

_ORIGIN = ("seed", "index")
"""Features that identify an example of a corpus."""
_ALWAYS = ("shininess",)
"""Features that held-out batches always hold, so that all stages can share them."""

SEEN_MASK = "seen_mask"
"""Feature: the mask that the object is cut out with; losses and measures take the true one."""

Batch = dict[str, Any]


class Data:
    """The training and held-out batches of a run.

    Args:
        paths: folders of corpora with complete train splits; each batch mixes all of them.
        config: config of the run.
        rows: (k, n): the training batches hold only the k-th of n equal parts of each batch.
        photographs: folders of things and places whose hash is `config.cutouts`.

    Raises:
        FileNotFoundError: if a split is incomplete, or the cut-outs' folders are not given.
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
        self._paths, self._config, self._part = paths, config, rows[0]
        self._corpora = Corpora(paths, config, rows)
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
        batches = self._corpora.training(seed, (*features, *_ORIGIN), first_step)
        is_of_masks = stage.subnetworks == ("segmentation",)
        cutouts = self._cutouts if is_of_masks else None
        for step, batch in enumerate(batches, first_step):
            generator = np.random.default_rng((seed, step, self._part))
            if self._config.schedule.paints:
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
        sees = self._config.schedule.found_masks and "segmentation" not in stage.subnetworks
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

    def blamed(self, batch: Batch, rows: Sequence[int]) -> str:
        """Return words that identify examples of a batch and say what mends them.

        Args:
            batch: batch of `training`.
            rows: rows of the examples, at least one.
        """
        origins = [(int(batch["seed"][row]), int(batch["index"][row])) for row in rows]
        return self._corpora.blamed(origins)

    @functools.cached_property
    def _cutouts(self) -> Cutouts | None:
        if self._photographs is None:
            return None
        return Cutouts(*self._photographs, self._config.architecture.size)

    def _held_out(self, features: Collection[str]) -> Iterator[Batch]:
        share = self._config.schedule.validation_examples / len(self._paths)
        batches = math.ceil(share / self._config.schedule.batch_size)
        yield from self._corpora.held_out(features, batches)


def without_origin(batch: Batch) -> Batch:
    """Return a batch without `seed` and `index`, which the networks must not get."""
    return {name: value for name, value in batch.items() if name not in _ORIGIN}


def _check_sizes(paths: Sequence[Path], size: int) -> None:
    """Raise ValueError if images cannot be averaged down to the networks' size."""
    for path in paths:
        stored = Split(path, "train").size or size
        if stored % size:
            raise ValueError(
                f"{path} holds images of {stored} pixels, which cannot be averaged to the {size} "
                f"that the networks take: pass --size with a divisor of {stored}, or render with "
                f"--size {size} or a multiple of it"
            )
