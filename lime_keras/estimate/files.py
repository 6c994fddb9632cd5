"""The files of the estimate of one photo."""

import json
import os
from collections.abc import Collection
from pathlib import Path

import numpy as np

from lime_keras.estimate import interchange, preview
from lime_keras.io import atomic, photo
from lime_keras.material import Material
from lime_keras.optics import colour
from lime_keras.outputs import OUTPUTS

_LONGEST = 200
"""Largest number of bytes of a stem: a file's name has at most 255."""


def write(folder: Path, name: str, source: Path, image_srgb: np.ndarray, material: Material) -> str:
    """Write the files of an estimate, `NAME.json` with its numbers last.

    Each layer becomes `NAME-LAYER.png`, 8 bits; a layer of linear radiance also becomes
    `NAME-LAYER.exr`, half floats. `NAME-preview.png` shows the estimate. A complete material also
    becomes `NAME.mtl`, `NAME.gltf` and `NAME-mitsuba.json`.

    Args:
        folder: existing folder for the files.
        name: beginning of the files' names.
        source: path of the photo, recorded in `NAME.json`.
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        material: estimate from the photo.

    Returns:
        The text of `NAME.json`.

    Raises:
        OSError: if a file cannot be written.
    """
    _write_layers(folder, name, material)
    photo.write(folder / f"{name}-preview.png", preview.sheet(image_srgb, material))
    if material.whole() is not None:
        scene = json.dumps(interchange.mitsuba_scene(material), indent=1)
        atomic.write(folder / f"{name}.mtl", interchange.wavefront(material, name))
        atomic.write(folder / f"{name}.gltf", interchange.gltf(material, name))
        atomic.write(folder / f"{name}-mitsuba.json", scene + "\n")
    numbers = json.dumps({"photo": str(source)} | material.to_json(), indent=1, allow_nan=False)
    atomic.write(folder / f"{name}.json", numbers + "\n")
    return numbers


def remark(material: Material) -> str | None:
    """Return what to tell of the material's files beside it, or None."""
    if material.whole() is None or not material.mask_coverage:
        return None
    return interchange.warning(material)


def distinct_names(sources: Collection[Path]) -> list[str]:
    """Return a file stem for each source; sources of the same stem are numbered from 2.

    Stems so long that a layer's file could not be named after them are cut.
    """
    names: list[str] = []
    for path in sources:
        stem = path.stem
        while len(os.fsencode(stem)) > _LONGEST:
            stem = stem[:-1]
        name, number = stem, 2
        while name in names:
            name, number = f"{stem}-{number}", number + 1
        names.append(name)
    return names


def _write_layers(folder: Path, name: str, material: Material) -> None:
    """Write each layer in a format for viewing and, if its range needs it, as OpenEXR."""
    for layer, image in material.layers.items():
        path = folder / f"{name}-{layer}.png"
        output = OUTPUTS.get(layer)
        if output is not None and output.levels is not None:
            low, high = output.levels
            photo.write(path, (image - low) / (high - low))
            continue
        if output is not None:
            photo.write(path.with_suffix(".exr"), image)
            # The copy for viewing: bright parts are compressed, then encoded for a screen.
            image = image / (1 + image)
        photo.write(path, colour.linear_to_srgb(np.clip(image, 0, 1)))
