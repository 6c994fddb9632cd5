"""The TFRecord schema of a training example: its encoder and its parser.

`docs/reference/records.md` lists the features with their shapes, units and ranges.
"""

import re
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import tensorflow as tf

from lime_keras.optics.environment import STORED_SHAPE

SCHEMA_VERSION = 1  # version of the schema
LARGEST_HALF = 65504.0
COMPRESSION = 2  # zlib's compression level, 0…9: a fifth faster than 4, and files 6.5 % larger

DAMAGED = (tf.errors.DataLossError, tf.errors.InvalidArgumentError, UnicodeDecodeError)
"""What TensorFlow raises at damaged records: the last where its message quotes them, as text."""

_BYTE_IMAGES = {"image": 3, "mask": 1}
_HALF_IMAGES = {
    "diffuse_shading": 1,
    "specular_shading": 1,
    "mirror": 1,
    "normal": 3,
    "environment": 1,
}
_VECTORS = {"camera": (4,), "diffuse_albedo": (3,)}
_SCALARS = ("specular_albedo", "shininess", "ambient")
_STRINGS = ("shape", "light")
_INTEGERS = ("seed", "index")

FEATURES = (*_BYTE_IMAGES, *_HALF_IMAGES, *_VECTORS, *_SCALARS, *_STRINGS, *_INTEGERS)


def encode(example: Mapping[str, Any]) -> bytes:
    """Serialise one example.

    Radiance above 65,504, the limit of half precision, is stored as 65,504.

    Args:
        example: a value for each of `FEATURES`, as `docs/reference/records.md` describes it.

    Raises:
        ValueError: if a feature is missing or unknown, has a wrong shape, is not finite, or lies
            outside its range.
    """
    _check(example)
    features: dict[str, tf.train.Feature] = {"schema": _integers([SCHEMA_VERSION])}
    for name in _BYTE_IMAGES:
        pixels = np.round(np.asarray(example[name], np.float32) * 255).astype(np.uint8)
        features[name] = _bytes(_png(pixels))
    for name in _HALF_IMAGES:
        features[name] = _bytes(_half_png(example[name]))
    for name in (*_VECTORS, *_SCALARS):
        values = np.asarray(example[name], np.float32).reshape(-1)
        features[name] = tf.train.Feature(float_list=tf.train.FloatList(value=values))
    for name in _STRINGS:
        features[name] = _bytes(str(example[name]).encode())
    for name in _INTEGERS:
        features[name] = _integers([int(example[name])])
    message = tf.train.Example(features=tf.train.Features(feature=features))
    return message.SerializeToString(deterministic=True)


def parse(serialized: Any, features: Collection[str] = FEATURES) -> dict[str, tf.Tensor]:
    """Decode one example, eagerly or inside `tf.data`.

    Args:
        serialized: scalar string tensor or bytes.
        features: names of the features to decode; the images take most of the time.

    Returns:
        Tensors with the names, shapes and units of `docs/reference/records.md`, as float32;
        strings and integers keep their types.

    Raises:
        ValueError: if a feature is unknown.
        tf.errors.InvalidArgumentError: if the bytes are no example or have another schema version.
    """
    if unknown := sorted(set(features) - set(FEATURES)):
        raise ValueError(f"records hold no {', '.join(unknown)}, but {', '.join(FEATURES)}")
    types: dict[str, Any] = dict.fromkeys((*_BYTE_IMAGES, *_HALF_IMAGES, *_STRINGS), tf.string)
    types |= dict.fromkeys((*_VECTORS, *_SCALARS), tf.float32)
    types |= dict.fromkeys(_INTEGERS, tf.int64)
    spec = {
        name: tf.io.FixedLenFeature(_VECTORS.get(name, ()), types[name])
        for name in FEATURES
        if name in features
    }
    example = _stored(serialized, spec)
    for name in filter(spec.__contains__, _BYTE_IMAGES):
        pixels = tf.io.decode_png(example[name], _BYTE_IMAGES[name])
        example[name] = tf.cast(pixels, tf.float32) / 255.0
    for name in filter(spec.__contains__, _HALF_IMAGES):
        # The bits of half floats, as `_half_png` stores them.
        bits = tf.io.decode_png(example[name], _HALF_IMAGES[name], tf.uint16)
        example[name] = tf.cast(tf.bitcast(bits, tf.float16), tf.float32)
    if "environment" in spec:
        example["environment"] = tf.ensure_shape(example["environment"], (*STORED_SHAPE, 1))
    return example


def words(error: Exception) -> str:
    """Return an error out of `DAMAGED` in one line, without TensorFlow's names of operations."""
    if isinstance(error, UnicodeDecodeError):
        return "its bytes are no example"
    first_line = str(getattr(error, "message", error)).splitlines()[0]
    return re.sub(r"\{\{.*?\}\} *| *\[Op:.*", "", first_line)


def image_png(serialized: Any) -> tf.Tensor:
    """Return the PNG of an example's image as it is stored, a scalar string.

    Arguments and errors are those of `parse`.
    """
    return _stored(serialized, {"image": tf.io.FixedLenFeature((), tf.string)})["image"]


def _stored(serialized: Any, spec: Mapping[str, Any]) -> dict[str, tf.Tensor]:
    """Return the features of an example as they are stored, after a check of its schema."""
    schema = tf.io.FixedLenFeature([], tf.int64)
    example = tf.io.parse_single_example(serialized, {**spec, "schema": schema})
    check = tf.debugging.assert_equal(
        example.pop("schema"),
        tf.constant(SCHEMA_VERSION, tf.int64),
        f"records of another schema (this is version {SCHEMA_VERSION}): render the corpus again",
    )
    with tf.control_dependencies([check] if check is not None else []):
        return {name: tf.identity(value) for name, value in example.items()}


def _check(example: Mapping[str, Any]) -> None:
    """Raise ValueError if an example does not fit the schema."""
    where = f"seed {example.get('seed')}, index {example.get('index')}"
    if set(example) != set(FEATURES):
        missing, unknown = set(FEATURES) - set(example), set(example) - set(FEATURES)
        raise ValueError(
            f"an example needs exactly the features of records.FEATURES: missing "
            f"{sorted(missing)}, unknown {sorted(unknown)} ({where})"
        )
    size = max((*np.shape(example["image"]), 1)[0], 1)
    expected: dict[str, tuple[int, ...]] = {
        name: (size, size, channels) for name, channels in (_BYTE_IMAGES | _HALF_IMAGES).items()
    }
    expected["environment"] = (*STORED_SHAPE, 1)
    expected |= _VECTORS | dict.fromkeys(_SCALARS, ())
    for name, shape in expected.items():
        value = np.asarray(example[name])
        if value.shape != shape:
            raise ValueError(f"{name} has shape {value.shape}, expected {shape} ({where})")
        if not np.all(np.isfinite(value)):
            raise ValueError(f"{name} is not finite ({where}): look at the mesh and the light")
        low, high = _range(name)
        if value.size and (value.min() < low or value.max() > high):
            raise ValueError(
                f"{name} lies in [{value.min()}, {value.max()}], expected [{low}, {high}] ({where})"
            )


def _range(name: str) -> tuple[float, float]:
    """Return the lowest and the highest value that a feature may hold."""
    if name in (*_BYTE_IMAGES, "diffuse_albedo", "specular_albedo"):
        return 0.0, 1.0
    if name in ("normal", "camera"):
        return -np.inf, np.inf
    return 0.0, np.inf


def _half_png(image: Any) -> bytes:
    """Return the PNG of the bits of an image in half precision."""
    values = np.clip(np.asarray(image, np.float32), -LARGEST_HALF, LARGEST_HALF)
    # Adding 0 turns −0 into 0, whose bits compress better.
    return _png((values.astype(np.float16) + np.float16(0)).view(np.uint16))


def _png(pixels: np.ndarray) -> bytes:
    return tf.io.encode_png(pixels, compression=COMPRESSION).numpy()


def _bytes(*values: bytes) -> tf.train.Feature:
    return tf.train.Feature(bytes_list=tf.train.BytesList(value=values))


def _integers(values: list[int]) -> tf.train.Feature:
    return tf.train.Feature(int64_list=tf.train.Int64List(value=values))
