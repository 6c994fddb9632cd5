"""The files of the estimate of one photo."""

import json
import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from lime_keras.estimate import interchange, preview
from lime_keras.io import atomic, photo
from lime_keras.io.scanner import folded
from lime_keras.material import Material
from lime_keras.optics import colour
from lime_keras.outputs import OUTPUTS, Output

_ROWS = 64  # number of rows of a layer that are encoded at once

_WRITERS = 2  # number of layers that are written at the same time; each takes memory of its own

_LONGEST = 200  # largest number of bytes of a stem: a file's name has at most 255


def write_pictures(folder: Path, name: str, material: Material) -> list[str]:
    """Write the layers of an estimate and, if its photo is known, its preview.

    Each layer becomes `NAME-LAYER.png`, 8 bits; a layer of linear radiance also becomes
    `NAME-LAYER.exr`, half floats. `NAME-preview.png` shows the estimate.

    Args:
        folder: existing folder for the files.
        name: beginning of the files' names.
        material: estimate from a photo.

    Returns:
        The names of the files.

    Raises:
        OSError: if a file cannot be written.
    """
    written = _write_layers(folder, name, material)
    if material.image_srgb is not None and "mask" in material.layers:
        written.append(f"{name}-preview.png")
        photo.write(folder / written[-1], preview.sheet(material.image_srgb, material))
    return written


def write_formats(folder: Path, name: str, material: Material) -> list[str]:
    """Write a complete material as `NAME.mtl`, `NAME.gltf` and `NAME-mitsuba.json`.

    Returns:
        The names of the files; none if a number of the material is missing.

    Raises:
        OSError: if a file cannot be written.
    """
    if material.whole() is None:
        return []
    scene = json.dumps(interchange.mitsuba_scene(material), indent=1)
    texts = {
        f"{name}.mtl": interchange.wavefront(material, name),
        f"{name}.gltf": interchange.gltf(material, name),
        f"{name}-mitsuba.json": scene + "\n",
    }
    for file, text in texts.items():
        atomic.write(folder / file, text)
    return list(texts)


def distinct_names(sources: Iterable[Path]) -> list[str]:
    """Return a name for the files of each source: its path without the suffix.

    Sources whose files would have the same names are numbered from 2. Names that differ in case or
    in the form of accents alone count as the same, as they are on some systems. Names so long that
    a layer's file could not be named after them are cut.

    Args:
        sources: paths of photos and videos, relative to where they were looked for.
    """
    # A table of all results has this name, too (`gallery`).
    taken = {"materials"}
    names = []
    for path in sources:
        end = path.stem
        while len(os.fsencode(end)) > _LONGEST:
            end = end[:-1]
        stem = name = (path.parent / end).as_posix()
        number = 2
        # The scene for Mitsuba of `a` has the name of the numbers of `a-mitsuba`.
        while not taken.isdisjoint(_taking(name)):
            name, number = f"{stem}-{number}", number + 1
        taken.update(_taking(name))
        names.append(name)
    return names


def _taking(name: str) -> set[str]:
    """Return the names that other results must not have."""
    return {folded(name), folded(f"{name}-mitsuba")}


def _write_layers(folder: Path, name: str, material: Material) -> list[str]:
    """Write each layer for viewing and, if its range needs it, as OpenEXR; return the names."""

    def write_layer(layer: str) -> list[str]:
        path, image = folder / f"{name}-{layer}.png", material.layers[layer]
        output = OUTPUTS.get(layer)
        paths = [path]
        if output is not None and output.levels is None:
            paths.append(path.with_suffix(".exr"))
            photo.write(paths[-1], image)
        photo.write(path, _viewed(image, output))
        return [path.name for path in paths]

    # Compression takes most of the time, and one core.
    with ThreadPoolExecutor(_WRITERS) as pool:
        return [file for files in pool.map(write_layer, material.layers) for file in files]


def _viewed(image: np.ndarray, output: Output | None) -> np.ndarray:
    """Return a layer `(H, W, C)` for viewing, uint8; `output` is None for a layer of a photo."""
    out = np.empty(image.shape, np.uint8)
    # Row by row: what lies between would take several times the memory of a large photo.
    for start in range(0, len(image), _ROWS):
        part = image[start : start + _ROWS]
        if output is not None and output.levels is not None:
            low, high = output.levels
            part = (part - low) / (high - low)
        elif output is not None:
            # Bright parts are compressed, then encoded for a screen.
            part = colour.linear_to_srgb(np.clip(part / (1 + part), 0, 1))
        else:
            part = colour.linear_to_srgb(np.clip(part, 0, 1))
        out[start : start + _ROWS] = np.rint(255 * np.clip(part, 0, 1))
    return out
