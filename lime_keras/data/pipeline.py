"""Shards → parsed, photographed, resized, shuffled, batched `tf.data`.

A dataset's elements are dictionaries named as in `records`, batched along the first axis, with
`exponent_bin` `(B,)` and `clipped` `(B, S, S, 3)` added.
"""

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

import tensorflow as tf
import tensorflow.experimental.numpy as tnp

from lime_keras.data import records
from lime_keras.data.camera import SCENE, photograph
from lime_keras.data.corpus import Split
from lime_keras.data.flip import flip
from lime_keras.data.repaint import repaint
from lime_keras.optics import colour, shininess

FEATURES = (*records.FEATURES, "clipped", "exponent_bin")
"""All that a batch may hold."""
LEARNT_FROM = (
    "image",
    "mask",
    "diffuse_shading",
    "specular_shading",
    "mirror",
    "diffuse_albedo",
    "specular_albedo",
    "ambient",
    "clipped",
    "exponent_bin",
)
"""What the losses read: no backend is fed strings, and no normals are decoded for nothing."""

_SHUFFLE = 2048
"""Serialised examples held for shuffling: some 400 MB at 256 × 256."""
_AHEAD = 256
"""Serialised examples to go on with while the next epoch's are gathered: some 50 MB."""
_LAYERS = ("diffuse_shading", "specular_shading", "mirror", "normal")
_CHANNELS = {"image": 3, "clipped": 3, "mask": 1} | dict.fromkeys(_LAYERS, 1) | {"normal": 3}
_SOURCES = {"clipped": "image", "exponent_bin": "shininess"}
"""What the features that are not stored are computed from."""


def training_shards(corpus: Path) -> tuple[list[Path], list[Path]]:
    """Split the train split's shards into those for training and the last tenth for validation.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if there are fewer than two shards.
    """
    paths = Split(corpus, "train").shard_paths()
    if len(paths) < 2:
        raise ValueError(
            f"{corpus}/train has {len(paths)} shard; training needs at least 2, one of them for "
            "validation: render more examples or pass a smaller --shard-size"
        )
    held_out = max(1, len(paths) // 10)
    return paths[:-held_out], paths[-held_out:]


def training(
    shards: list[Path],
    *,
    size: int,
    batch_size: int,
    seed: int,
    first_step: int = 0,
    camera: bool = True,
    flips: bool = False,
    repaints: bool = False,
    features: Collection[str] = LEARNT_FROM,
) -> tf.data.Dataset:
    """Endless shuffled batches; the same seed gives the same ones, from any `first_step` on.

    Every epoch holds each example once, in an order of its own; batches may span two.

    Args:
        shards: files to read.
        size: height and width of the images; a divisor of the stored size.
        batch_size: examples a batch.
        seed: of the order and the photos, in any process: TensorFlow's global one has no part.
        first_step: batches to pass over, when training is resumed. Of epochs that are over nothing
            is read, and of the one it falls into nothing is decoded.
        camera: whether to photograph the scenes anew each time (`camera.photograph`).
        flips: whether every other scene, drawn anew each time, is a mirror's (`flipping.flip`).
        repaints: whether each scene has albedos drawn anew each time (`repainting.repaint`).
        features: what the batches are to hold; nothing else is decoded without need.

    Raises:
        ValueError: if a shard is cut off, all are empty, or a feature is unknown.
    """
    count, first = _check_whole(shards), first_step * batch_size
    if not count:
        raise ValueError(
            f"no example to train on in {', '.join(map(str, shards))}: render more of them"
        )
    paths = tf.constant([str(path) for path in shards])
    epochs = tf.data.Dataset.range(first // count, tf.int64.max)
    dataset = epochs.flat_map(lambda epoch: _epoch(paths, tf.stack([seed, epoch])))
    dataset = dataset.skip(first % count).enumerate(first).prefetch(_AHEAD)
    prepare = _prepare(size, features, camera, flips, repaints)

    def prepared(position: tf.Tensor, serialized: tf.Tensor) -> dict[str, tf.Tensor]:
        return prepare(serialized, tf.stack([tf.constant(seed, tf.int64), position]))

    dataset = dataset.map(prepared, num_parallel_calls=tf.data.AUTOTUNE, deterministic=True)
    return dataset.batch(batch_size, drop_remainder=True).prefetch(2)


def _epoch(paths: tf.Tensor, seed: tf.Tensor) -> tf.data.Dataset:
    """All serialised examples once, in an order that depends on the seed `(2,)` alone."""
    of_files, of_records = tf.unstack(tf.random.split(seed))
    paths = tf.random.experimental.stateless_shuffle(paths, of_files)
    dataset = tf.data.Dataset.from_tensor_slices(paths)
    dataset = dataset.interleave(tf.data.TFRecordDataset, cycle_length=4)
    # `Dataset.shuffle` would add the global seed to its own.
    shuffled = tf.raw_ops.ShuffleDataset(
        input_dataset=tf.data.experimental.to_variant(dataset),
        buffer_size=_SHUFFLE,
        seed=of_records[0],
        seed2=of_records[1],
        output_types=[tf.string],
        output_shapes=[()],
        reshuffle_each_iteration=False,
    )
    return tf.data.experimental.from_variant(shuffled, tf.TensorSpec((), tf.string))


def evaluation(
    shards: list[Path],
    *,
    size: int,
    batch_size: int,
    camera: bool = False,
    features: Collection[str] = FEATURES,
) -> tf.data.Dataset:
    """Every example once, in order; the last batch may be smaller.

    With `camera`, each is photographed by the camera of its own seed and index. Arguments and
    errors as in `training`.
    """
    _check_whole(shards)
    dataset = tf.data.TFRecordDataset([str(path) for path in shards])
    prepare = _prepare(size, features, camera)
    dataset = dataset.map(prepare, num_parallel_calls=tf.data.AUTOTUNE, deterministic=True)
    return dataset.batch(batch_size).prefetch(2)


def naming_damage(batches: Iterable[Any], shards: list[Path]) -> Iterator[Any]:
    """Yield what `batches` yields; say where it is if a record turns out to be damaged.

    TensorFlow's own errors name neither file nor record, so the shards are searched for it then.

    Raises:
        ValueError: naming the shard, its first damaged record, and how to mend it.
    """
    iterator = iter(batches)
    while True:
        try:
            batch = next(iterator)
        except StopIteration:
            return
        except (tf.errors.DataLossError, tf.errors.InvalidArgumentError):
            for path in shards:
                _check_records(path)
            raise
        yield batch


def resize(example: dict[str, tf.Tensor], size: int) -> dict[str, tf.Tensor]:
    """Bring an example's images to `size` × `size` by area averaging; those of that size stay.

    The image is averaged in linear light, and `clipped` `(size, size, 3)`, by default the channels
    at `colour.CLIPPED` and above, is 1 where any part of the area was clipped, whose mean is then
    only a lower bound. Layers are averaged over the covered part of each area, so a silhouette
    stays as bright as the object; the camera is scaled along.

    Args:
        example: as of `records.parse`: all of it, or some of it with the mask.
        size: a divisor of the stored height and width.

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
    """The example with each `factor` × `factor` pixels of it made one."""

    def blocks(name: str, image: tf.Tensor) -> tf.Tensor:
        return tf.reshape(image, (size, factor, size, factor, _CHANNELS[name]))

    def area_mean(name: str, image: tf.Tensor) -> tf.Tensor:
        return tf.reduce_mean(blocks(name, image), axis=(1, 3))

    out = dict(example)
    out["mask"] = area_mean("mask", example["mask"])
    if "image" in example:
        linear = area_mean("image", _as_float(colour.srgb_to_linear(example["image"], tnp)))
        out["image"] = _as_float(colour.linear_to_srgb(linear, tnp))
        out["clipped"] = tf.reduce_max(blocks("clipped", example["clipped"]), axis=(1, 3))
    for name in filter(example.__contains__, _LAYERS):
        covered = area_mean(name, example[name] * example["mask"])
        out[name] = tf.math.divide_no_nan(covered, out["mask"])
    if "normal" in example:
        # l2_normalize leaves the zero normals outside the mask at zero.
        out["normal"] = tf.math.l2_normalize(out["normal"], axis=-1)
    if "camera" in example:
        out["camera"] = example["camera"] / tf.cast(factor, tf.float32)
    return out


def _as_float(values: tf.Tensor) -> tf.Tensor:
    """float32 again, which TensorFlow's NumPy functions widen."""
    return tf.cast(values, tf.float32)


def _check_whole(shards: list[Path]) -> int:
    """Number of records in shards, after refusing one whose records do not end where it does.

    Of a record cut off within its first 12 bytes TensorFlow itself says nothing at all. Only the
    lengths are read; what lies between is checked as it is decoded.
    """
    count = 0
    for path in shards:
        size, end = path.stat().st_size, 0
        with path.open("rb") as file:
            while end < size:
                file.seek(end)
                # Length (8 bytes), its checksum (4), the record, its checksum (4).
                end += 16 + int.from_bytes(file.read(8), "little")
                count += 1
        if end != size:
            whole = _check_records(path)
            raise _broken(path, whole, f"the file ends within it, after {size} bytes")
    return count


def _check_records(path: Path) -> int:
    """Number of records in a shard, after decoding them all.

    Raises:
        ValueError: naming the first that is damaged.
    """
    count = 0
    try:
        for serialized in tf.data.TFRecordDataset(str(path)):
            _refuse_non_finite(records.parse(serialized))
            count += 1
    except (tf.errors.DataLossError, tf.errors.InvalidArgumentError) as error:
        raise _broken(path, count, _plain(error)) from error
    return count


def _refuse_non_finite(example: dict[str, tf.Tensor]) -> dict[str, tf.Tensor]:
    """The example, if all its numbers are finite; pictures of whole levels cannot be otherwise."""
    return {
        name: value
        if name in ("image", "mask") or not value.dtype.is_floating
        else tf.debugging.check_numerics(value, f"{name} is not finite")
        for name, value in example.items()
    }


def _plain(error: tf.errors.OpError) -> str:
    """TensorFlow's message without the operations it passed through."""
    return re.sub(r"\{\{.*?\}\} *| *\[Op:.*", "", str(error.message).splitlines()[0])


def _broken(path: Path, record: int, found: str) -> ValueError:
    """The error for a damaged record, counted from 0."""
    return ValueError(
        f"{path} is broken: record {record} (the first is 0) cannot be read: {found}; delete the "
        "file and its .json, and run the same `lime-render` command again"
    )


def _prepare(
    size: int,
    features: Collection[str],
    camera: bool,
    flips: bool = False,
    repaints: bool = False,
) -> Callable[..., dict[str, tf.Tensor]]:
    """The map function: bytes, and a seed → the features of an example of that size.

    The seed is the camera's, which has one of its own by default, and that of flips and paint.
    """
    if unknown := sorted(set(features) - set(FEATURES)):
        raise ValueError(f"a batch can hold no {', '.join(unknown)}, but {', '.join(FEATURES)}")
    edges = tf.constant(shininess.LOG_EDGES[1:-1], tf.float32)
    wanted = {"mask", *(_SOURCES.get(name, name) for name in features)}
    if camera:
        wanted |= {"seed", "index", *SCENE}
    if repaints:
        wanted |= {*SCENE}

    def prepare(serialized: tf.Tensor, seed: tf.Tensor | None = None) -> dict[str, tf.Tensor]:
        example = _refuse_non_finite(records.parse(serialized, wanted))
        if repaints:
            # The camera splits the seed in two, a flip takes the third of three.
            example = repaint(example, tf.random.split(seed, 4)[3])
        if camera:
            example = photograph(example, seed)
        example = resize(example, size)
        if flips:
            drawn = tf.random.stateless_uniform((), tf.random.split(seed, 3)[2])
            whole = example
            example = tf.cond(drawn < 0.5, lambda: flip(whole), lambda: whole)
        if "exponent_bin" in features:
            log = tf.math.log(tf.maximum(example["shininess"], 1.0)) / math.log(10.0)
            # The same slack as shininess.bin_of.
            above = log + shininess.BIN_WIDTH * 1e-6 >= edges
            example["exponent_bin"] = tf.reduce_sum(tf.cast(above, tf.int32))
        return {name: example[name] for name in features}

    return prepare
