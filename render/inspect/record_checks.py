"""Checks of a single record, which every record of a corpus must pass.

Letters as in the paper: n normal, o direction to the viewer.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from lime_keras.optics import shading, shininess
from lime_keras.optics.environment import STORED_SHAPE
from lime_keras.optics.material_law import AMBIENT

from ..scene.example import LEAST_COVERAGE
from . import recomposition
from .recomposition import FLOAT_ROUNDING, HALF_ROUNDING, covered_pixels, pixels_at

_LAYERS = ("diffuse_shading", "specular_shading", "mirror")


@dataclass(frozen=True)
class Expected:
    """The values that a split's manifest prescribes for each record."""

    seed: int
    size: int
    shapes: frozenset[str]
    lights: frozenset[str]


def faults(example: Mapping[str, np.ndarray], expected: Expected) -> list[tuple[str, str]]:
    """Return the faults of a record, each as its kind and a text of what was found and expected.

    Args:
        example: parsed record (see `records.parse`) in NumPy.
        expected: values that the split's manifest prescribes.
    """
    out = [*_origin(example, expected)]
    square = expected.size, expected.size
    sizes = dict.fromkeys(("image", "mask", "normal", *_LAYERS), square)
    out += _sizes(example, sizes | {"environment": STORED_SHAPE})
    if any(kind == "size" for kind, _ in out):
        return out
    for check in (_material, _camera, _layer_values, _mask):
        out += check(example)
    if any(kind in ("mask", "layer", "camera", "material") for kind, _ in out):
        # The checks below would only repeat such a fault.
        return out
    out += _normals(example)
    if (misfit := recomposition.misfit(example)) is not None:
        out.append(("recomposition", misfit))
    return out


def _origin(example: Mapping, expected: Expected) -> Iterator[tuple[str, str]]:
    if example["seed"] != expected.seed:
        yield "seed", f"seed is {example['seed']}, expected the corpus' {expected.seed}"
    yield from _name(example, "shape", expected.shapes)
    yield from _name(example, "light", expected.lights)


def _name(example: Mapping, kind: str, allowed: frozenset[str]) -> Iterator[tuple[str, str]]:
    text = example[kind].decode(errors="replace")
    if text not in allowed:
        yield "name", f"{kind} is {text}, which is none of the manifest's {len(allowed)}"


def _sizes(example: Mapping, sizes: Mapping[str, tuple[int, int]]) -> Iterator[tuple[str, str]]:
    for name, (height, width) in sizes.items():
        shape = example[name].shape[:2]
        if shape != (height, width):
            yield "size", f"{name} is {shape[1]}x{shape[0]}, expected {width}x{height}"


def _material(example: Mapping) -> Iterator[tuple[str, str]]:
    exponents = (10.0**shininess.LOG_LOW, 10.0**shininess.LOG_HIGH)
    for name, (low, high) in (
        ("diffuse_albedo", (0.0, 1.0)),
        ("specular_albedo", (0.0, 1.0)),
        ("shininess", exponents),
        ("ambient", AMBIENT),
    ):
        value = example[name]
        slack = FLOAT_ROUNDING * high
        if not np.all((value >= low - slack) & (value <= high + slack)):
            yield "material", f"{name} is {_numbers(value)}, expected {low:g} … {high:g}"


def _camera(example: Mapping) -> Iterator[tuple[str, str]]:
    camera = example["camera"]
    if not (np.all(np.isfinite(camera)) and np.all(camera[:2] > 0)):
        yield "camera", f"camera is {_numbers(camera)}, expected fx > 0, fy > 0, finite cx and cy"


def _layer_values(example: Mapping) -> Iterator[tuple[str, str]]:
    outside = example["mask"] == 0
    for name in (*_LAYERS, "environment"):
        low, high = float(example[name].min()), float(example[name].max())
        # Comparisons with NaN are false.
        if not (low >= 0 and high < np.inf):
            yield "layer", f"{name} lies in {low:g} … {high:g}, expected finite radiance from 0 on"
        if name != "environment" and (stray := np.count_nonzero(example[name][outside])):
            yield "layer", f"{name} is not 0 in {stray} pixels outside the mask"


def _mask(example: Mapping) -> Iterator[tuple[str, str]]:
    coverage = float(example["mask"].mean())
    # The stored mask is rounded to 8 bits.
    if coverage < LEAST_COVERAGE - 0.5 / 255:
        yield "mask", f"the object covers {coverage:.2%}, expected at least {LEAST_COVERAGE:.0%}"


def _normals(example: Mapping) -> Iterator[tuple[str, str]]:
    covered = covered_pixels(example)
    normal = pixels_at(example["normal"], covered)
    squared = np.einsum("ij,ij->i", normal, normal)
    wrong = ~(np.abs(squared - 1) <= 2 * (HALF_ROUNDING + FLOAT_ROUNDING) + HALF_ROUNDING**2)
    if wrong.any():
        worst = np.sqrt(squared[wrong][np.argmax(np.abs(squared[wrong] - 1))])
        yield "normal", f"{wrong.sum()} normals are not unit, one is {worst:.4g} long"
    size = len(example["mask"])
    view = pixels_at(shading.view_directions(example["camera"], size, size), covered)
    behind = np.count_nonzero(np.einsum("ij,ij->i", normal, view) <= 0)
    if behind:
        yield "normal", f"{behind} of {len(normal)} normals face away from the viewer"
    outside = np.flatnonzero(example["mask"] == 0)
    if stray := np.count_nonzero(pixels_at(example["normal"], outside).any(axis=-1)):
        yield "normal", f"normals are not 0 in {stray} pixels outside the mask"


def _numbers(value: np.ndarray) -> str:
    return ", ".join(f"{number:g}" for number in np.atleast_1d(value))
