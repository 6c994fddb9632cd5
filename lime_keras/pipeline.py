"""Shards → parsed, resized, shuffled, batched `tf.data`.

A dataset's elements are dictionaries named as in `records`, batched along the first axis, with
`exponent_bin` `(B,)` and `clipped` `(B, S, S, 3)` added.
"""

import math
from collections.abc import Callable
from pathlib import Path

import tensorflow as tf
import tensorflow.experimental.numpy as tnp

from lime_keras import colour, records, shininess
from lime_keras import corpus as corpus_files

_SHUFFLE = 2048
"""Serialised examples held for shuffling: some 400 MB at 256 × 256."""
_LAYERS = ("diffuse_shading", "specular_shading", "mirror", "normal")
_CHANNELS = {"image": 3, "mask": 1} | dict.fromkeys(_LAYERS, 1) | {"normal": 3}


def training_shards(corpus: Path) -> tuple[list[Path], list[Path]]:
    """Split the train split's shards into those for training and the last tenth for validation.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if there are fewer than two shards.
    """
    paths = corpus_files.shard_paths(corpus, "train")
    if len(paths) < 2:
        raise ValueError(
            f"{corpus}/train has {len(paths)} shard; training needs at least 2, one of them for "
            "validation: render more examples or pass a smaller --shard-size"
        )
    held_out = max(1, len(paths) // 10)
    return paths[:-held_out], paths[-held_out:]


def training(
    shards: list[Path], *, size: int, batch_size: int, seed: int, first_step: int = 0
) -> tf.data.Dataset:
    """Endless shuffled batches; the same seed gives the same order, from any `first_step` on.

    Args:
        shards: files to read.
        size: height and width of the images; a divisor of the stored size.
        batch_size: examples a batch.
        seed: of the order, beside TensorFlow's global one.
        first_step: batches to pass over without decoding them, when training is resumed.

    Raises:
        ValueError: if a shard is cut off.
    """
    _check_whole(shards)
    dataset = tf.data.Dataset.from_tensor_slices([str(path) for path in shards])
    dataset = dataset.shuffle(len(shards), seed=seed, reshuffle_each_iteration=True)
    dataset = dataset.interleave(tf.data.TFRecordDataset, cycle_length=4)
    dataset = dataset.shuffle(_SHUFFLE, seed=seed, reshuffle_each_iteration=True).repeat()
    dataset = dataset.skip(first_step * batch_size)
    dataset = dataset.map(_prepare(size), num_parallel_calls=tf.data.AUTOTUNE, deterministic=True)
    return dataset.batch(batch_size, drop_remainder=True).prefetch(2)


def evaluation(shards: list[Path], *, size: int, batch_size: int) -> tf.data.Dataset:
    """Every example once, in order; the last batch may be smaller.

    Raises:
        ValueError: if a shard is cut off.
    """
    _check_whole(shards)
    dataset = tf.data.TFRecordDataset([str(path) for path in shards])
    dataset = dataset.map(_prepare(size), num_parallel_calls=tf.data.AUTOTUNE, deterministic=True)
    return dataset.batch(batch_size).prefetch(2)


def resize(example: dict[str, tf.Tensor], size: int) -> dict[str, tf.Tensor]:
    """Bring an example's images to `size` × `size` by area averaging.

    The image is averaged in linear light, and `clipped` `(size, size, 3)` added: 1 where any part
    of the area was clipped, whose mean is then only a lower bound. Layers are averaged over the
    covered part of each area, so a silhouette stays as bright as the object; the camera is scaled
    along.

    Raises:
        tf.errors.InvalidArgumentError: if `size` does not divide the stored size.
    """
    stored = tf.shape(example["mask"])[0]
    divides = tf.debugging.assert_equal(
        stored % size, 0, f"the stored images cannot be averaged to {size}: pass a divisor"
    )
    with tf.control_dependencies([divides] if divides is not None else []):
        factor = stored // size

    def blocks(name: str, image: tf.Tensor) -> tf.Tensor:
        return tf.reshape(image, (size, factor, size, factor, _CHANNELS[name]))

    def area_mean(name: str, image: tf.Tensor) -> tf.Tensor:
        return tf.reduce_mean(blocks(name, image), axis=(1, 3))

    out = dict(example)
    linear = area_mean("image", _as_float(colour.srgb_to_linear(example["image"], tnp)))
    out["image"] = _as_float(colour.linear_to_srgb(linear, tnp))
    clipped = tf.cast(example["image"] >= colour.CLIPPED, tf.float32)
    out["clipped"] = tf.reduce_max(blocks("image", clipped), axis=(1, 3))
    out["mask"] = area_mean("mask", example["mask"])
    for name in _LAYERS:
        covered = area_mean(name, example[name] * example["mask"])
        out[name] = tf.math.divide_no_nan(covered, out["mask"])
    # l2_normalize leaves the zero normals outside the mask at zero.
    out["normal"] = tf.math.l2_normalize(out["normal"], axis=-1)
    out["camera"] = example["camera"] / tf.cast(factor, tf.float32)
    return out


def _as_float(values: tf.Tensor) -> tf.Tensor:
    """float32 again, which TensorFlow's NumPy functions widen."""
    return tf.cast(values, tf.float32)


def _check_whole(shards: list[Path]) -> None:
    """Refuse a shard whose records do not end where the file does.

    TensorFlow's own error names no file, and of a record cut off within its first 12 bytes it says
    nothing at all. Only the lengths are read; what lies between is checked as it is decoded.
    """
    for path in shards:
        size, end = path.stat().st_size, 0
        with path.open("rb") as file:
            while end < size:
                file.seek(end)
                # Length (8 bytes), its checksum (4), the record, its checksum (4).
                end += 16 + int.from_bytes(file.read(8), "little")
        if end != size:
            raise ValueError(
                f"{path} is broken: it has {size} bytes, its records end at {end}; delete it and "
                "its .json, and run the same `lime-render` command again"
            )


def _prepare(size: int) -> Callable[[tf.Tensor], dict[str, tf.Tensor]]:
    """The map function: bytes → example of that size, with its exponent's class."""
    edges = tf.constant(shininess.LOG_EDGES[1:-1], tf.float32)

    def prepare(serialized: tf.Tensor) -> dict[str, tf.Tensor]:
        example = resize(records.parse(serialized), size)
        log = tf.math.log(tf.maximum(example["shininess"], 1.0)) / math.log(10.0)
        # The same slack as shininess.bin_of.
        above = log + shininess.BIN_WIDTH * 1e-6 >= edges
        example["exponent_bin"] = tf.reduce_sum(tf.cast(above, tf.int32))
        return example

    return prepare
