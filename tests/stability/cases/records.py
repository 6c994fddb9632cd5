"""Cases for records, and for the pipeline and the camera that process them."""

import functools
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tensorflow as tf

from lime_keras.data import camera, pipeline, records
from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import environment
from lime_keras.optics.shininess import BIN_COUNT, BIN_WIDTH

from .. import srgb_standard
from ..precisions import SINGLE
from ..refusals import refusal

_SIZE = 8
_RADIANCES = (0.0, 1e-8, 6e-8, 1e-4, 1.0, 65504.0, 1e8, 1e30)
_UNSOUND = {"NaN": np.nan, "infinity": np.inf}
_IMAGES = ("diffuse_shading", "specular_shading", "mirror", "normal", "environment")
_NUMBERS = ("diffuse_albedo", "specular_albedo", "shininess", "ambient", "camera")
_PRECISION = SINGLE.name


def cases() -> list[Case]:
    """Return the cases of records, bins, area means and camera."""
    out = []

    def add(part: str, name: str, measure: Callable[..., Outcome], *arguments: Any) -> None:
        out.append(Case(part, name, _PRECISION, functools.partial(measure, *arguments)))

    for radiance in _RADIANCES:
        add("records", f"radiance {radiance:g}, there and back", _there_and_back, radiance)
    for name in (*_IMAGES, *_NUMBERS):
        for unsound, value in _UNSOUND.items():
            add("records", f"{unsound} in {name}, refused when written", _unwritten, name, value)
            add("records", f"{unsound} in {name}, refused when read", _unread, name, value, False)
    add("camera", "NaN in the scene, refused when read", _unread, "mirror", np.nan, True)
    add("bins", "every edge, in the pipeline's graph", _bins_in_the_graph)
    for coverage in (0.0, 1 / 255, 1.0):
        for radiance in (0.0, 1e-4, 65504.0):
            name = f"one pixel in four covered {coverage:.3g}, radiance {radiance:g}"
            add("area means", name, _area_means, coverage, radiance)
    for level in (0.0, 1.0):
        add("area means", f"image of level {level:g}", _area_mean_of_image, level)
    for radiance in (0.0, 1e-8, 1.0, 65504.0):
        add("camera", f"scene of radiance {radiance:g}", _photographed, radiance)
    return out


def _example(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the features of a record, a grey object that fills the image, with some changed."""
    even = np.ones((_SIZE, _SIZE, 1))
    return {
        "image": 0.5 * np.ones((_SIZE, _SIZE, 3)),
        "mask": even,
        "diffuse_shading": even,
        "specular_shading": even,
        "mirror": even,
        "normal": even * np.array([0.0, 0.0, 1.0]),
        "environment": np.ones((*environment.STORED_SHAPE, 1)),
        "camera": np.array([16.0, 16.0, 4.0, 4.0]),
        "diffuse_albedo": np.full(3, 0.5),
        "specular_albedo": 0.5,
        "shininess": 30.0,
        "ambient": 0.0,
        "shape": "plane",
        "light": "furnace",
        "seed": 0,
        "index": 0,
    } | dict(changes)


def _with(name: str, value: float) -> np.ndarray:
    """Return a feature with its last number replaced by `value`."""
    out = np.array(_example({})[name], np.float64)
    out.reshape(-1)[-1:] = value
    return out


def _there_and_back(radiance: float) -> Outcome:
    """Try a layer written and read: half floats keep 11 binary digits, down to 2⁻²⁴."""
    layer = np.full((_SIZE, _SIZE, 1), radiance)
    found = records.parse(records.encode(_example({"mirror": layer})), ("mirror",))["mirror"]
    right = min(radiance, 65504.0)
    return Outcome(Compared(found.numpy(), right, right, right * 2.0**-11 + 2.0**-25))


def _unwritten(name: str, value: float) -> Outcome:
    broken = _example({name: _with(name, value)})
    return refusal(lambda: records.encode(broken), f"{name} is not finite", "seed 0, index 0")


def _unread(name: str, value: float, with_camera: bool) -> Outcome:
    """Try to read a record that holds a bad value, as another program could write it."""
    message = tf.train.Example.FromString(records.encode(_example({})))
    feature = message.features.feature[name]
    if name in _IMAGES:
        bits = _with(name, value).astype(np.float16).view(np.uint16)
        feature.bytes_list.value[0] = tf.io.encode_png(bits).numpy()
    else:
        feature.float_list.value[-1] = value
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shard.tfrecord"
        sound = records.encode(_example({}))
        _write_shard(path, [sound, message.SerializeToString()])

        def read() -> list[Any]:
            batches = pipeline.evaluation(
                [path], size=_SIZE, batch_size=1, camera=with_camera, features=(name,)
            )
            return list(pipeline.naming_damage(batches, [path]))

        outcome = refusal(read, "record 1", f"{name} is not finite", "lime-render")
        return Outcome(note=outcome.note.replace(f"{folder}/", ""))


def _write_shard(path: Path, serialized: list[bytes]) -> None:
    with tf.io.TFRecordWriter(str(path)) as writer:
        for record in serialized:
            writer.write(record)


def _bins_in_the_graph() -> Outcome:
    """Try the bins in the pipeline: an edge belongs to the upper bin, values beyond to the last."""
    exponents = {0.0: 0, 0.5: 0, 1.0: 0, 1000.0: BIN_COUNT - 1, 1e6: BIN_COUNT - 1}
    for k in range(1, BIN_COUNT):
        edge = 10 ** (BIN_WIDTH * k)
        exponents |= {edge: k, edge * (1 - 1e-4): k - 1}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "shard.tfrecord"
        _write_shard(path, [records.encode(_example({"shininess": s})) for s in exponents])
        batches = pipeline.evaluation(
            [path], size=_SIZE, batch_size=len(exponents), features=("exponent_bin",)
        )
        [batch] = batches.as_numpy_iterator()
    right = np.array(list(exponents.values()))
    return Outcome(Compared(batch["exponent_bin"], right, right, 0.0))


def _area_means(coverage: float, radiance: float) -> Outcome:
    """Try layers made smaller: averaged over the covered pixels, and 0 where none is covered."""
    mask = np.zeros((_SIZE, _SIZE, 1), np.float32)
    mask[::2, ::2] = coverage
    layer = np.full_like(mask, radiance)
    example = {"mask": tf.constant(mask), "mirror": tf.constant(layer)}
    found = pipeline.resize(example, _SIZE // 2)["mirror"].numpy()
    right = float(np.float32(radiance)) * (coverage > 0)
    return Outcome(SINGLE.compare(found, right, right, right))


def _area_mean_of_image(level: float) -> Outcome:
    image = np.full((_SIZE, _SIZE, 3), level, np.float32)
    example = {"mask": tf.ones((_SIZE, _SIZE, 1)), "image": tf.constant(image)}
    found = pipeline.resize(example, _SIZE // 2)
    image, clipped = found["image"].numpy(), found["clipped"].numpy()
    right = np.stack([np.full_like(image, level), np.full_like(clipped, level == 1)])
    return Outcome(SINGLE.compare(np.stack([image, clipped]), right, right, right + 0.055))


def _photographed(radiance: float) -> Outcome:
    """Try the level and the clipping of an even scene under twenty cameras.

    The exposure changes by half a stop at most. Noise hardly ever reaches six standard deviations
    of the smallest sensor. The tolerance of 8 / 255 is for JPEG, which rounds and overshoots.
    """
    level = srgb_standard.encoded(np.clip(radiance, 0, 1))
    layer = np.full((_SIZE, _SIZE, 1), radiance)
    scene = {
        "image": np.full((_SIZE, _SIZE, 3), level),
        "diffuse_shading": layer,
        "specular_shading": layer,
    }
    example = records.parse(records.encode(_example(scene)))
    photos = [
        camera.photograph(example, camera.radiance(example), tf.constant([seed, 0]))
        for seed in range(20)
    ]
    found = np.stack([photo["image"] for photo in photos])
    clipped = np.stack([photo["clipped"] for photo in photos])
    low, high = radiance * 2**-0.5, radiance * 2**0.5
    noise = 6 * np.sqrt((np.array([low, high]) + 4 / 1000) / 1000)
    ends = np.clip(np.array([low, high]) + noise * [-1, 1], 0, 1)
    low_level, high_level = srgb_standard.encoded(ends)
    sure = float(low >= 1), float(high >= 1)
    return Outcome(
        Compared(
            np.concatenate([found.ravel(), clipped.ravel()]),
            np.repeat([low_level, sure[0]], found.size),
            np.repeat([high_level, sure[1]], found.size),
            np.repeat([8 / 255, 0.0], found.size),
        )
    )
