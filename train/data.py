"""The training batches of a stage, and the validation batches that it is evaluated on.

Both are read from kept photos (`train.photos`). The photos of a stage are made once, before its
first batch, and then seen again and again: in another order each time, flipped or not.
"""

import hashlib
import itertools
import zlib
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import sleep
from typing import Any

import keras
import numpy as np

from lime_keras.data.corpus import Split
from lime_keras.networks import subnetwork_names
from lime_keras.networks.wiring import Networks
from lime_keras.optics.material_law import UNIFORM

from . import terms
from .config import Config
from .devices import Devices
from .photos import answers, making
from .photos.flips import flip
from .photos.kept import INPUT_MASK, PREDICTED, Kept
from .photos.making import OnMaking, Recipe
from .stages import Stage

_ORIGIN = ("seed", "index")  # features that identify an example of a corpus
_MASK_FEATURES = ("image", "mask", *_ORIGIN)  # features that SegmentationNet alone is trained with

Batch = dict[str, Any]


class Data:
    """The training and validation batches of a run.

    Args:
        paths: folders of corpora with complete train splits; each batch mixes all of them.
        config: config of the run.
        folder: folder of the run; photos are kept in its folder `photos`.
        devices: devices of the run, by default one; the process that leads makes the photos.
        on_making: function called as photos and answers are made.
        photographs: folders of things and places whose hash is `config.cutouts`.

    Raises:
        FileNotFoundError: if a split is incomplete, or the cut-outs' folders are not given.
        ValueError: if images are of a size that does not fit.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        config: Config,
        folder: Path,
        devices: Devices | None = None,
        on_making: OnMaking = lambda what, done, total: None,
        photographs: tuple[Path, Path] | None = None,
    ):
        self._paths, self._config, self._folder = tuple(paths), config, folder / "photos"
        self._devices, self._on_making = devices or Devices(1), on_making
        for path in paths:
            Split(path, "train").check_size(config.architecture.size)
        if config.cutouts is not None and photographs is None:
            raise FileNotFoundError("this run learns from cut-outs: pass its --cutouts again")
        self._photographs = photographs
        self._masker: keras.Model | None = None
        self._opened: dict[str, Kept] = {}

    @property
    def features(self) -> tuple[str, ...]:
        """The names of the features that some stage, or the evaluation of the system, reads."""
        config = self._config
        names = terms.terms_of(
            subnetwork_names(config.architecture), config.schedule.losses, config.compositing
        )
        return terms.features_of(names)

    def set_masker(self, masker: keras.Model | None) -> None:
        """Let input masks be what a SegmentationNet finds, in some photos; None: true ones."""
        self._masker = masker

    def with_input_mask(self, stage: Stage, features: Collection[str]) -> tuple[str, ...]:
        """Return a stage's features, with `kept.INPUT_MASK` if its masks are not the true ones."""
        sees = self._config.schedule.found_masks and "segmentation" not in stage.subnetworks
        return (*features, *([INPUT_MASK] if sees else []))

    def training(
        self,
        stage: Stage,
        features: Collection[str],
        first_step: int,
        frozen: Networks | None = None,
    ) -> Iterator[Batch]:
        """Make a stage's photos, if they are missing, and return its batches, from a step on.

        The batches have no end; each is read while one is learnt from. Each also holds `seed` and
        `index`, which identify its examples.

        Args:
            stage: the stage.
            features: names of its features; also `kept.INPUT_MASK`, and those of `frozen`.
            first_step: number of batches before the first one.
            frozen: subnetworks whose predictions are among the features (`answers.independent`).
        """
        photos = self._photos(stage)
        replies = self._answers(photos, features, frozen or {}, self._seed("input masks"))
        size, seed = self._config.schedule.batch_size, self._seed(stage.name)
        wanted = (*features, *_ORIGIN)
        # Longer stages, which other architectures may lack, add photos behind those of this one.
        count = min(photos.count, stage.steps * size)

        def read(step: int) -> Batch:
            # Each photo once an epoch, in an own order.
            places = range(step * size, (step + 1) * size)
            rows = np.array([making.order(count, seed, at // count)[at % count] for at in places])
            batch = _read(photos, replies, rows, wanted)
            if self._config.schedule.flips:
                flip(batch, np.random.default_rng((seed, step)).random(size) < 0.5)
            return batch

        return _ahead(read, first_step)

    def validation(
        self, features: Collection[str], frozen: Networks | None = None
    ) -> Iterator[Batch]:
        """Yield the validation batches: equally many of each path, where it has enough.

        They show scenes that are not trained on, each once, without paint. `kept.INPUT_MASK` is
        that of `set_masker`'s network, or the true one if there is none.
        """
        schedule = self._config.schedule
        each = -(-schedule.validation_examples // len(self._paths))
        recipe = self._recipe(
            0,
            features=(*self.features, *_ORIGIN),
            materials=self._config.materials or (),
            validation=each,
        )
        photos = self._kept(recipe, each * len(self._paths), "validation photos")
        replies = self._answers(photos, features, frozen or {}, None)
        for first in range(0, photos.count, schedule.batch_size):
            rows = np.arange(first, min(first + schedule.batch_size, photos.count))
            yield _read(photos, replies, rows, features)

    def _photos(self, stage: Stage) -> Kept:
        """Return the photos of a stage, made if they were not.

        All stages but `segmentation` share theirs; where nothing is painted or cut out, all do.
        """
        config, schedule = self._config, self._config.schedule
        alone = ("segmentation",)
        is_apart = schedule.paints or config.cutouts is not None
        of_masks = is_apart and stage.subnetworks == alone
        steps = max(
            one.steps
            for one in schedule.stages(config.architecture)
            if not is_apart or (one.subnetworks == alone) == of_masks
        )
        kind = "mask photos" if of_masks else "photos"
        recipe = self._recipe(
            self._seed(kind),
            features=_MASK_FEATURES if of_masks else (*self.features, *_ORIGIN),
            materials=(config.materials or (UNIFORM,)) if schedule.repaints else (),
            paint=("clutter" if of_masks else "prints") if schedule.paints else None,
            cutouts=self._photographs if of_masks else None,
        )
        return self._kept(recipe, min(config.photos, steps * schedule.batch_size), kind)

    def _recipe(self, seed: int, **laws: Any) -> Recipe:
        cutouts = self._config.cutouts if laws.get("cutouts") else None
        return Recipe(
            corpora=self._paths,
            corpus_sha256=self._config.corpus_sha256,
            seed=seed,
            size=self._config.architecture.size,
            camera=self._config.schedule.camera,
            cutouts_sha256=cutouts,
            **laws,
        )

    def _kept(self, recipe: Recipe, most: int, title: str) -> Kept:
        """Return the photos of a recipe, made if they were not."""
        key = hashlib.sha256(f"{recipe.key()} {most}".encode()).hexdigest()[:16]
        if key not in self._opened:
            folder = self._folder / key
            count = making.count_of(recipe, folder, most)
            kept = Kept(folder, count, recipe.features, recipe.size)
            self._complete(kept, lambda: making.make(recipe, kept, title, self._on_making))
            self._opened[key] = kept
        return self._opened[key]

    def _answers(
        self, photos: Kept, features: Collection[str], frozen: Networks, seed: int | None
    ) -> Kept | None:
        """Return the input masks of photos and the predictions of frozen subnetworks, if wanted."""
        if INPUT_MASK not in features and not frozen:
            return None
        finds, networks = INPUT_MASK in features, dict(frozen)
        if finds and self._masker is not None:
            networks = {"segmentation": self._masker, **frozen}
        seed = seed if finds else None  # without a masker, the true masks
        text = f"{photos.folder.name} {seed} {answers.sha256(networks)}"
        key = hashlib.sha256(text.encode()).hexdigest()[:16]
        if key not in self._opened:
            size = self._config.architecture.size
            local = self._devices.local_copies(networks)
            kept = Kept(self._folder / key, photos.count, answers.features(frozen), size)
            self._complete(kept, lambda: answers.make(photos, kept, local, seed, self._on_making))
            self._opened[key] = kept
        return self._opened[key]

    def _complete(self, kept: Kept, make: Any) -> None:
        """Make what is to be kept in the process that leads; the others wait for it."""
        if self._devices.leads:
            make()
        while not kept.is_complete:
            sleep(0.2)

    def _seed(self, what: str) -> int:
        return zlib.crc32(f"{self._config.seed} {what}".encode())


def _ahead(read: Callable[[int], Batch], first_step: int) -> Iterator[Batch]:
    """Yield what is read of each step, by a thread that is one step ahead."""
    with ThreadPoolExecutor(1) as reader:
        coming = reader.submit(read, first_step)
        for step in itertools.count(first_step + 1):
            batch, coming = coming.result(), reader.submit(read, step)
            yield batch


def without_origin(batch: Batch) -> Batch:
    """Return a batch without `seed` and `index`, which the networks must not get."""
    return {name: value for name, value in batch.items() if name not in _ORIGIN}


def _read(photos: Kept, replies: Kept | None, rows: np.ndarray, features: Collection[str]) -> Batch:
    """Return some photos, and what was predicted of them."""
    names = {name for name in features if name == INPUT_MASK or name.startswith(PREDICTED)}
    batch = photos.read(rows, [name for name in features if name not in names])
    return batch | (replies.read(rows, names) if replies is not None else {})
