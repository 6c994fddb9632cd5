"""The making of photos: record → radiance → paint → camera → size, a photo for each number.

A photo follows from the recipe and its number alone. So processes may make any of them, in any
order, and an interrupted making goes on. TensorFlow is imported where photos are made.
"""

import dataclasses
import functools
import hashlib
import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

import numpy as np

from lime_keras import console
from lime_keras.data.corpus import Split

from . import kept, paint
from .kept import Kept

_CUT_OUT = 0.5  # share of SegmentationNet's photos that show a cut-out, if there are any
_PAINTED = ("object", "background", "mask", "painted")  # features of a scene that paint changes
_UNPAINTED = ("diffuse_shading", "diffuse_albedo")  # features that paint reads beside them

OnMaking = Callable[[str, int, int], None]
"""Function called with what is made, how much of it is there, and how much there will be."""


@dataclasses.dataclass(frozen=True)
class Recipe:
    """All that photos of some corpora follow from, beside their numbers.

    Attributes:
        corpora: folders with complete train splits.
        corpus_sha256: hash of their shards (`config.corpus_sha256`).
        seed: seed of the order of the scenes and of all that is drawn for a photo.
        size: height and width of the photos in pixels.
        features: names of the features of a photo that are kept.
        camera: whether the camera takes the photo; if not, it is the scene as rendered.
        materials: laws of new albedos (`radiance.scene`); none for those of the scene.
        paint: `prints`, `clutter`, or None for none (`photos.paint`).
        cutouts: folders of things and places whose cut-outs half of the photos show, or None.
        validation: None for photos of the scenes that are trained on, in an order of their own each
            time all were seen; else how many validation scenes of each corpus are photographed,
            once each, in order, by their own seeds.
    """

    corpora: tuple[Path, ...]
    corpus_sha256: str
    seed: int
    size: int
    features: tuple[str, ...]
    camera: bool
    materials: tuple[str, ...] = ()
    paint: str | None = None
    cutouts: tuple[Path, Path] | None = None
    cutouts_sha256: str | None = None
    validation: int | None = None

    def key(self) -> str:
        """Return a hash of the recipe, whatever the folders are called."""
        fields = dataclasses.asdict(self) | {"corpora": None, "cutouts": None, "form": kept.FORMAT}
        return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()[:16]


class Scenes:
    """The records that photos of a recipe show, by the number of the photo.

    Raises:
        FileNotFoundError: if a split is incomplete.
        MissingExtra: if TensorFlow is not installed.
        ValueError: if a split is too small or damaged.
    """

    def __init__(self, recipe: Recipe):
        console.require("making photos", "tensorflow")
        console.import_tensorflow()
        from lime_keras.data import pipeline

        self._recipe = recipe
        self.shards: list[Path] = []
        self._records: list[tuple[Path, int, int]] = []
        for corpus in recipe.corpora:
            training, validation = pipeline.training_shards(corpus)
            shards = training if recipe.validation is None else validation
            self._records += pipeline.record_spans(shards)[: recipe.validation]
            self.shards += shards
        if not self._records:
            raise ValueError(
                f"no example to train on in {', '.join(map(str, self.shards))}: render more of them"
            )

    def __len__(self) -> int:
        return len(self._records)

    def record(self, number: int) -> bytes:
        """Return the serialised example that a photo shows."""
        from lime_keras.data import pipeline

        epoch, place = divmod(number % 2**62, len(self))
        if self._recipe.validation is None:
            place = order(len(self), self._recipe.seed, epoch)[place]
        return pipeline.read_record(self._records[place])


@functools.lru_cache(4)
def order(count: int, seed: int, epoch: int) -> np.ndarray:
    """Return the numbers below `count`, `(count,)`, in an order of their own each epoch."""
    return np.random.default_rng((seed, epoch)).permutation(count)


class Studio:
    """Takes the photos of a recipe; TensorFlow is needed.

    Raises:
        FileNotFoundError: if a split is incomplete, or a folder of cut-outs holds nothing of use.
        ValueError: if a split is too small or damaged.
    """

    def __init__(self, recipe: Recipe):
        self._recipe, self._scenes = recipe, Scenes(recipe)
        self._cutouts: dict[int, Any] = {}
        if recipe.cutouts is not None:
            from .cutouts import Cutouts

            for size in {Split(corpus, "train").size for corpus in recipe.corpora}:
                self._cutouts[size] = Cutouts(*recipe.cutouts, size)

    def photos(self, numbers: range) -> dict[str, np.ndarray]:
        """Return the photos of these numbers: features by name, with the photos as rows.

        Raises:
            ValueError: if a record is damaged; the message names it.
        """
        from lime_keras.data import pipeline

        wears = self._recipe.paint == "clutter"
        shown = [self._scenes.record(number) for number in numbers]
        others = [self._scenes.record(number - 1) if wears else b"" for number in numbers]
        taken = map(self._take, [np.array(numbers)], [shown], [others])
        (rows,) = pipeline.naming_damage(taken, self._scenes.shards)
        return {name: value.numpy() for name, value in rows.items()}

    @functools.cached_property
    def _take(self) -> Callable[[Any, Any, Any], dict[str, Any]]:
        """The function from numbers and serialised examples to photos as rows.

        It builds its dataset in a graph, as a dataset of each part would be traced anew.
        """
        import tensorflow as tf

        def take(numbers: Any, shown: Any, others: Any) -> dict[str, Any]:
            dataset = tf.data.Dataset.from_tensor_slices((numbers, shown, others))
            dataset = dataset.map(self._photo, num_parallel_calls=2, deterministic=True)
            options = tf.data.Options()
            options.threading.private_threadpool_size = 2
            dataset = dataset.with_options(options).batch(tf.size(numbers, tf.int64))
            return dataset.get_single_element()

        rows = [tf.TensorSpec([None], kind) for kind in (tf.int64, tf.string, tf.string)]
        return tf.function(take, input_signature=rows)

    def _photo(self, number: Any, serialized: Any, other: Any) -> dict[str, Any]:
        """Return the features of a photo as tensors, in the graph of a dataset."""
        import tensorflow as tf

        from lime_keras.data import camera, pipeline

        from . import radiance

        # The scene, and paint on it.
        recipe = self._recipe
        seed = tf.stack([tf.constant(recipe.seed, tf.int64), number])
        if recipe.validation is not None:
            own = pipeline.parse_finite(serialized, ("seed", "index"))
            seed = tf.stack([own["seed"], own["index"]])
        # Parts of the seed: 0 to 2 are the camera's, 3 the albedos'.
        drawn = tf.random.split(seed, 4)[3]
        example = radiance.scene(serialized, drawn, recipe.features, recipe.materials)
        example["painted"] = tf.zeros_like(example["mask"])
        if recipe.paint is not None or recipe.cutouts is not None:
            example = self._paint(example, number, other)
        # The camera.
        light = example["object"] + example["background"]
        if recipe.camera:
            example = camera.photograph(example, light, seed)
        else:
            if recipe.materials or recipe.paint or recipe.cutouts is not None:
                example["image"] = camera.developed(light)
            example["cast"] = tf.zeros(4)
        return pipeline.select(pipeline.resize(example, recipe.size), recipe.features)

    def _paint(self, example: dict[str, Any], number: Any, other: Any) -> dict[str, Any]:
        """Return the example with its features of `_PAINTED` painted."""
        import tensorflow as tf

        from lime_keras.data import camera, records

        texture = example["object"]
        if self._recipe.paint == "clutter":
            image = records.parse(other, ("image",))["image"]
            texture = tf.image.resize(camera.linear(image), tf.shape(texture)[:2], "area")

        scene = [example[name] for name in (*_PAINTED, *_UNPAINTED)]
        out = tf.numpy_function(self._painted, [number, texture, *scene], [tf.float32] * 4)
        for name, value in zip(_PAINTED, out, strict=True):
            value.set_shape(example[name].shape)
        return example | dict(zip(_PAINTED, out, strict=True))

    def _painted(self, number: Any, texture: Any, *features: Any) -> list[np.ndarray]:
        """Return the features of `_PAINTED`, painted, of a scene of these and of `_UNPAINTED`."""
        scene = dict(zip((*_PAINTED, *_UNPAINTED), features, strict=True))
        generator = np.random.default_rng((self._recipe.seed, int(number)))
        light, behind, mask = (scene[name] for name in ("object", "background", "mask"))
        marks = scene["painted"]
        if self._recipe.paint == "prints":
            light, marks = paint.prints(scene, generator)
        elif self._recipe.paint == "clutter":
            light, behind = paint.clutter(scene, texture, generator)
        if self._cutouts and generator.random() < _CUT_OUT:
            light, behind, mask = self._cutouts[len(mask)].compose(generator)
        return [np.asarray(one, np.float32) for one in (light, behind, mask, marks)]


def count_of(recipe: Recipe, folder: Path, most: int) -> int:
    """Return how many photos there are to make: `most`, or one of each scene if they never change.

    Photos that the folder holds are counted without their corpora.

    Raises:
        FileNotFoundError: if a split is incomplete.
        ValueError: if a split is too small or damaged.
    """
    changes = recipe.camera or recipe.materials or recipe.paint or recipe.cutouts
    if recipe.validation is None and changes:
        return most
    if (count := kept.count_in(folder)) is not None:
        return count
    return min(most, len(Scenes(recipe)))


def make(recipe: Recipe, photos: Kept, title: str, on_making: OnMaking) -> None:
    """Make the photos that are missing; processes of their own make many at the same time.

    Raises:
        FileNotFoundError: if a split is incomplete, or a folder of cut-outs holds nothing of use.
        OSError: if the disk is full.
        RuntimeError: if a process died.
        MissingExtra: if TensorFlow is not installed.
        ValueError: if a split is too small or damaged.
    """
    if photos.is_complete:
        return
    console.require("making photos", "tensorflow")
    missing = photos.begin()
    done = photos.count - sum(map(len, missing))
    for part in _finished(recipe, photos, missing):
        photos.mark(part)
        done += len(part)
        on_making(title, done, photos.count)
    photos.finish({"recipe": json.loads(json.dumps(dataclasses.asdict(recipe), default=str))})


def _finished(recipe: Recipe, photos: Kept, missing: list[range]) -> Iterator[range]:
    """Make parts of the photos, and yield each that is made."""
    processes = min(len(os.sched_getaffinity(0)), len(missing))
    if processes < 2:
        studio = Studio(recipe)
        for part in missing:
            photos.write(part.start, studio.photos(part))
            yield part
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(processes, context, _start)
    try:
        futures = {pool.submit(_make, recipe, photos, part): part for part in missing}
        for future in as_completed(futures):
            future.result()
            yield futures[future]
    except BrokenProcessPool as error:
        raise RuntimeError(
            "a process that made photos died: killed, or out of memory. What is made is kept; the "
            "same command goes on"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


def _start() -> None:
    """Prepare a process that makes photos: on one core, without a GPU; it ends with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    threads = dict.fromkeys(("TF_NUM_INTRAOP_THREADS", "TF_NUM_INTEROP_THREADS"), "1")
    os.environ |= {"KERAS_BACKEND": "tensorflow", "CUDA_VISIBLE_DEVICES": "-1", **threads}
    console.import_tensorflow()


_studio = functools.cache(Studio)  # opened once in a process that makes photos


def _make(recipe: Recipe, photos: Kept, part: range) -> None:
    photos.write(part.start, _studio(recipe).photos(part))
