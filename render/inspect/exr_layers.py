"""Export of one example as OpenEXR layers, for compositing programs and image viewers.

| channels | type | content |
|---|---|---|
| R, G, B | float | the input image over its background, decoded to linear Rec. 709 |
| mask.Y | float | coverage |
| diffuse_shading.Y, specular_shading.Y, mirror.Y | half | D, S and M |
| normal.X, normal.Y, normal.Z | half | camera space: x right, y up, z towards the camera |

The coverage is not stored as an alpha channel, because a viewer would cut the image out with it.
The environment has another size, and the parts of an EXR file should have the same size. So it is
a second file: channel Y in half, equirectangular in camera space, up at the top and the camera in
the middle.
"""

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import tensorflow as tf

from lime_keras.data import pipeline, records
from lime_keras.data.corpus import Split
from lime_keras.io import atomic, photo
from lime_keras.optics import colour

_LAYERS = (
    ("mask", "Y", oiio.FLOAT),
    ("diffuse_shading", "Y", oiio.HALF),
    ("specular_shading", "Y", oiio.HALF),
    ("mirror", "Y", oiio.HALF),
    ("normal", "XYZ", oiio.HALF),
)
_NUMBERS = ("specular_albedo", "shininess", "ambient")
_NAMES = ("shape", "light")


def environment_path(path: Path) -> Path:
    """Return the path of the file that holds the light of an exported example."""
    return path.with_name(f"{path.stem}-environment.exr")


def export(corpus: Path, split: str, index: int, out: Path) -> None:
    """Write the layers of an example to a file, and its environment to `environment_path(out)`.

    The layers have the values of the record, bit for bit. Material, camera (fx, fy, cx, cy in
    pixels) and origin (shape, light, seed, index) are attributes of the file.

    Args:
        corpus: folder of a corpus by `lime-render`.
        split: `train` or `test`.
        index: index of the example in the split.
        out: file to write, `.exr`.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if `out` has another suffix, there is no such example, or its shard is damaged.
        OSError: if a file cannot be written.
    """
    if out.suffix.lower() != ".exr":
        raise ValueError(f"{out} would be no OpenEXR: name it .exr")
    example = read(Split(corpus, split), index)
    channels = [("R", oiio.FLOAT), ("G", oiio.FLOAT), ("B", oiio.FLOAT)]
    images = [colour.srgb_to_linear(example["image"])]
    for name, axes, kind in _LAYERS:
        channels += [(f"{name}.{axis}", kind) for axis in axes]
        images.append(example[name])
    _write(out, channels, np.concatenate(images, axis=-1), _attributes(example))
    light = {"light": example["light"].decode()}
    _write(environment_path(out), [("Y", oiio.HALF)], example["environment"], light)


def read(split: Split, index: int) -> dict[str, Any]:
    """Read one record as NumPy arrays; only its own shard is opened.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if there is no such example, or its shard is damaged.
    """
    if not 0 <= index < split.count:
        raise ValueError(
            f"{split.folder} has no example {index}: pass one of 0 … {split.count - 1}"
        )
    shard, place = divmod(index, split.shard_size)
    path = split.shard_path(shard)
    if not path.is_file():
        raise FileNotFoundError(f"{path} is missing: run the same `lime-render` command again")
    dataset = tf.data.TFRecordDataset(str(path)).skip(place).take(1).map(records.parse)
    for example in pipeline.naming_damage(dataset, [path]):
        if int(example["index"]) == index:
            return {name: value.numpy() for name, value in example.items()}
    raise ValueError(
        f"{path}: record {place} is not example {index}, the shard is not the manifest's: "
        f"`lime-render verify {split.corpus} --split {split.name}` tells what else is wrong"
    )


def _attributes(example: dict[str, Any]) -> dict[str, Any]:
    """Return the attributes of a file; the seed is text, as EXR's integers are too short for it."""
    camera = zip(("fx", "fy", "cx", "cy"), example["camera"].tolist(), strict=True)
    return {
        **{name: example[name].decode() for name in _NAMES},
        **{name: float(example[name]) for name in _NUMBERS},
        "diffuse_albedo": tuple(example["diffuse_albedo"].tolist()),
        **{f"camera_{name}": value for name, value in camera},
        "seed": str(example["seed"]),
        "index": int(example["index"]),
    }


def _write(
    path: Path, channels: list[tuple[str, Any]], pixels: np.ndarray, attributes: dict[str, Any]
) -> None:
    """Write values `(H, W, C)` as an EXR file of channels by name and type, with attributes."""
    height, width = pixels.shape[:2]
    spec = oiio.ImageSpec(width, height, len(channels), oiio.FLOAT)
    spec.channelnames = tuple(name for name, _ in channels)
    spec.channelformats = tuple(oiio.TypeDesc(kind) for _, kind in channels)
    spec.attribute("compression", "zip")
    spec.attribute("oiio:ColorSpace", "lin_rec709_scene")
    for name, value in attributes.items():
        if isinstance(value, tuple):
            spec.attribute(name, oiio.TypeDesc("float[3]"), value)
        else:
            spec.attribute(name, value)
    with atomic.replacing(path) as partial:
        file = oiio.ImageOutput.create(str(partial))
        if file is None:
            raise OSError(f"{path} cannot be written: {oiio.geterror()}")
        written = file.open(str(partial), spec) and file.write_image(np.ascontiguousarray(pixels))
        if not (file.close() and written):
            raise OSError(f"{path} cannot be written: {file.geterror()}; make room on its disk")
        photo.check_written(path, partial)
