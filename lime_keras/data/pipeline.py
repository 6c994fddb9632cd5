"""The input pipeline: shards become photographed and resized batches of `tf.data`.

A batch is a dictionary of tensors with the examples along the first axis. Its entries are
the features of `records`, and also `exponent_bin` `(B,)`, the class of the exponent, and `clipped`
`(B, S, S, 3)`, 1 where a channel is clipped.
"""

import functools
import math
from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import tensorflow as tf
import tensorflow.experimental.numpy as tnp
from tqdm import tqdm

from lime_keras import console, processors
from lime_keras.data import records
from lime_keras.data.camera import SCENE, photograph, radiance
from lime_keras.data.corpus import Split
from lime_keras.io import untrusted
from lime_keras.optics import colour, shininess

FEATURES = (*records.FEATURES, "clipped", "cast", "exponent_bin")  # features that a batch can hold

_LAYERS = ("diffuse_shading", "specular_shading", "mirror", "normal")
_MARKS = ("clipped", "painted")
_CHANNELS = (
    {"image": 3, "clipped": 3, "painted": 1, "mask": 1} | dict.fromkeys(_LAYERS, 1) | {"normal": 3}
)
_SOURCES = {"clipped": "image", "painted": "mask", "cast": "mask", "exponent_bin": "shininess"}
"""Stored feature from which each feature that is not stored is computed."""


def training_shards(corpus: Path) -> tuple[list[Path], list[Path]]:
    """Return the paths of the train split's shards: for training, and for validation.

    The last tenth of the shards, and at least one shard, is the validation set.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if there are fewer than two shards, or a shard is not the manifest's.
    """
    paths = verified_shards(Split(corpus, "train"))
    if len(paths) < 2:
        raise ValueError(
            f"{corpus}/train has {len(paths)} shard; training needs at least 2, one of them for "
            "validation: render more examples or pass a smaller --shard-size"
        )
    count = max(1, len(paths) // 10)
    return paths[:-count], paths[-count:]


def verified_shards(split: Split) -> list[Path]:
    """Return the paths of a split's shards, each with the bytes that the manifest names.

    All shards are read once and hashed, in several threads; a shard that has not changed since is
    not hashed again by this process.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if a shard has other bytes: it is damaged, or records were removed, repeated or
            put in another place.
    """
    paths, expected = split.shard_paths(), split.sha256
    if len(paths) != len(expected):
        raise ValueError(
            f"{split.manifest_path} names {len(paths)} shards with {len(expected)} checksums: "
            "delete it and run the same `lime-render` command again"
        )
    sizes = [path.stat().st_size for path in paths]
    with (
        ThreadPoolExecutor(processors.count()) as threads,
        tqdm(
            total=sum(sizes),
            desc="checksums",
            unit="B",
            unit_scale=True,
            delay=2,
            **console.bar_options(),
        ) as bar,
    ):
        digests = threads.map(_digest, paths, (path.stat().st_mtime_ns for path in paths), sizes)
        for path, size, digest, wanted in zip(paths, sizes, digests, expected, strict=True):
            bar.update(size)
            if digest != wanted:
                raise ValueError(
                    f"{path} is not the shard of {split.manifest_path.name}: it is damaged, or "
                    "records were changed, removed, repeated or exchanged; delete the file and its "
                    ".json, and run the same `lime-render` command again"
                )
    return paths


@functools.cache
def _digest(path: Path, mtime_ns: int, size: int) -> str:
    """Return the SHA-256 of a file; its time of change and its size tell a changed file apart."""
    return untrusted.sha256(path)


def evaluation(
    shards: list[Path],
    *,
    size: int,
    batch_size: int,
    camera: bool = False,
    features: Collection[str] = FEATURES,
) -> tf.data.Dataset:
    """Return a dataset with every example once, in order; the last batch may be smaller.

    Args:
        shards: paths of the shards to read.
        size: height and width of the images; a divisor of the stored size.
        batch_size: number of examples in a batch.
        camera: whether to take a photo of each scene (`camera.photograph`), drawn from the
            example's own seed and index.
        features: names of the features in a batch.

    Raises:
        ValueError: if a feature is unknown.
    """
    dataset = tf.data.TFRecordDataset([str(path) for path in shards])
    dataset = dataset.map(
        _prepare(size, features, camera), num_parallel_calls=tf.data.AUTOTUNE, deterministic=True
    )
    return dataset.batch(batch_size).prefetch(2)


def naming_damage(batches: Iterable[Any], shards: list[Path]) -> Iterator[Any]:
    """Yield the items of `batches`; if a record is damaged, raise an error that locates it.

    TensorFlow's own errors name neither file nor record. After such an error, the shards are
    searched for the damaged record.

    Raises:
        ValueError: if a record is damaged; the message names the shard, its first damaged record
            and the repair.
    """
    try:
        yield from batches
    except records.DAMAGED:
        for path in shards:
            _check_records(path)
        raise


def resize(example: dict[str, tf.Tensor], size: int) -> dict[str, tf.Tensor]:
    """Resize an example's images to `size` × `size` by area averaging.

    The image is averaged in linear light. `clipped` `(size, size, 3)` is 1 where any part of an
    area was clipped, because the area's mean is then only a lower bound, and `painted` likewise;
    without `clipped` in the example, channels at `colour.CLIPPED` and above count as clipped.
    Layers are averaged over the covered part of each area, so a silhouette stays as bright as the
    object. The camera is scaled with the images.

    Args:
        example: example from `records.parse`, with all features or with some of them and the mask.
        size: height and width in pixels; a divisor of the stored height and width.

    Raises:
        tf.errors.InvalidArgumentError: if `size` does not divide the stored size.
    """
    out = dict(example)
    if "image" in example and "clipped" not in example:
        out["clipped"] = tf.cast(example["image"] >= colour.CLIPPED, tf.float32)
    stored = tf.shape(example["mask"])[0]
    divides = tf.debugging.assert_equal(
        stored % size, 0, f"the stored images cannot be averaged to {size}: pass a divisor"
    )
    with tf.control_dependencies([divides] if divides is not None else []):
        factor = stored // size
    out = tf.cond(factor == 1, lambda: out, lambda: _averaged(out, size, factor))
    for name in filter(out.__contains__, _CHANNELS):
        out[name] = tf.ensure_shape(out[name], (size, size, _CHANNELS[name]))
    return out


def _averaged(example: dict[str, tf.Tensor], size: int, factor: tf.Tensor) -> dict[str, tf.Tensor]:
    """Return the example with each area of `factor` × `factor` pixels averaged to one pixel."""

    def blocks(name: str, image: tf.Tensor) -> tf.Tensor:
        return tf.reshape(image, (size, factor, size, factor, _CHANNELS[name]))

    def area_mean(name: str, image: tf.Tensor) -> tf.Tensor:
        return tf.reduce_mean(blocks(name, image), axis=(1, 3))

    out = dict(example)
    out["mask"] = area_mean("mask", example["mask"])
    if "image" in example:
        # TensorFlow's NumPy functions widen.
        linear = tf.cast(colour.srgb_to_linear(example["image"], tnp), tf.float32)
        srgb = colour.linear_to_srgb(area_mean("image", linear), tnp)
        out["image"] = tf.cast(srgb, tf.float32)
    for name in filter(example.__contains__, _MARKS):
        out[name] = tf.reduce_max(blocks(name, example[name]), axis=(1, 3))
    for name in filter(example.__contains__, _LAYERS):
        covered = area_mean(name, example[name] * example["mask"])
        out[name] = tf.math.divide_no_nan(covered, out["mask"])
    if "normal" in example:
        # l2_normalize leaves the zero normals outside the mask at zero.
        out["normal"] = tf.math.l2_normalize(out["normal"], axis=-1)
    if "camera" in example:
        out["camera"] = example["camera"] / tf.cast(factor, tf.float32)
    return out


def record_spans(shards: Iterable[Path]) -> list[tuple[Path, int, int]]:
    """Return where the records of shards lie, in order: the shard, the first byte, the length."""
    spans = []
    for path in shards:
        size, end = path.stat().st_size, 0
        with path.open("rb") as file:
            while end < size:
                file.seek(end)
                # Length (8 bytes), its checksum (4), the record, its checksum (4).
                length = int.from_bytes(file.read(8), "little")
                spans.append((path, end + 12, length))
                end += 16 + length
    return spans


def read_record(span: tuple[Path, int, int]) -> bytes:
    """Return the serialised example at one of `record_spans`."""
    path, start, length = span
    with path.open("rb") as file:
        file.seek(start)
        return file.read(length)


def _check_records(path: Path) -> None:
    """Decode all records of a shard; raise a ValueError that names the first damaged one."""
    count = 0
    try:
        for serialized in tf.data.TFRecordDataset(str(path)):
            _refuse_non_finite(records.parse(serialized))
            count += 1
    except records.DAMAGED as error:
        raise ValueError(
            f"{path} is broken: record {count} (the first is 0) cannot be read: "
            f"{records.words(error)}; delete the file and its .json, and run the same "
            "`lime-render` command again"
        ) from error


def _refuse_non_finite(example: dict[str, tf.Tensor]) -> dict[str, tf.Tensor]:
    """Return the example; raise TensorFlow's error if a number is not finite.

    Pictures of 8 bits are always finite and are not checked.
    """
    return {
        name: value
        if name in ("image", "mask") or not value.dtype.is_floating
        else tf.debugging.check_numerics(value, f"{name} is not finite")
        for name, value in example.items()
    }


def _prepare(
    size: int, features: Collection[str], camera: bool
) -> Callable[[tf.Tensor], dict[str, tf.Tensor]]:
    """Return the function from a serialised example to its features at `size`.

    The photo depends on the example's own seed and index.
    """
    if unknown := sorted(set(features) - set(FEATURES)):
        raise ValueError(f"a batch can hold no {', '.join(unknown)}, but {', '.join(FEATURES)}")
    wanted = stored_for(features)
    if camera:
        wanted |= {"seed", "index", *SCENE}

    def prepare(serialized: tf.Tensor) -> dict[str, tf.Tensor]:
        example = parse_finite(serialized, wanted)
        if camera:
            example = photograph(example, radiance(example))
        else:
            example["cast"] = tf.zeros(4)
        return select(resize(example, size), features)

    return prepare


def stored_for(features: Collection[str]) -> set[str]:
    """Return the features of a record that are needed to make those of a batch."""
    return {"mask", *(_SOURCES.get(name, name) for name in features)}


def parse_finite(serialized: tf.Tensor, features: Collection[str]) -> dict[str, tf.Tensor]:
    """Decode one example (`records.parse`); TensorFlow's error if a number is not finite."""
    return _refuse_non_finite(records.parse(serialized, features))


def select(example: dict[str, tf.Tensor], features: Collection[str]) -> dict[str, tf.Tensor]:
    """Return these features of an example, among them the class of its exponent if it is one."""
    if "exponent_bin" in features:
        edges = tf.constant(shininess.LOG_EDGES[1:-1], tf.float32)
        log = tf.math.log(tf.maximum(example["shininess"], 1.0)) / math.log(10.0)
        # The slack is that of `shininess.bin_of`.
        above = log + shininess.BIN_WIDTH * 1e-6 >= edges
        example["exponent_bin"] = tf.reduce_sum(tf.cast(above, tf.int32))
    return {name: example[name] for name in features}
