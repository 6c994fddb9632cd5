"""Checks of a single record, which every record of a corpus must pass.

Letters as in the paper: n normal, o direction to the viewer, D, S and M; m_d, m_s, s and m_a.
"""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from lime_keras.data.corpus import Split
from lime_keras.optics import shading, shininess
from lime_keras.optics.environment import STORED_SHAPE
from lime_keras.optics.material_law import AMBIENT

from ..scene.example import LEAST_COVERAGE
from . import recomposition
from .recomposition import FLOAT_ROUNDING, HALF_ROUNDING, pixels_at

_LAYERS = ("diffuse_shading", "specular_shading", "mirror")
_PROBES = 16  # largest number of pixels in which D and S are computed again
_CANDIDATES_PER_PROBE = 8
_SMOOTH = 0.999
"""Least n·n' between neighbouring pixels in which D and S are computed again.

Where the surface bends more, a layer is a mean over normals that the record does not hold.
"""
_DIFFUSE_TOLERANCE = 0.25
"""Largest accepted error of D: median relative error against sums over the stored map.

Over 5,046 examples of mixed lights, the error is 0.1 % in the median, 2 % at the 99th percentile
and 17 % at most, from lamps smaller than a stored texel. A light turned by 90° gives 48 %.
"""
_TAIL = 0.01
"""Least divisor of a relative error of D or S, as a share of the layer's maximum.

In the tail of a lobe, half a texel of the stored map changes much: in two of 10,000 examples, flat
faces in a dark studio under lamps, values near 0 were off by 38 and 75 %.
"""
_SPECULAR_TOLERANCE, _SPECULAR_BLUR = 0.3, 4e-4
"""Largest accepted error of S at s = 0, and its growth with s.

The texels of the stored map are wider than a sharp lobe: in the examples above, the error is at
most 22 %, where s is below 10, 9 % where it is 100 to 200, and 20 % above 500.
"""


def faults(example: Mapping[str, np.ndarray], split: Split) -> list[tuple[str, str]]:
    """Return the faults of a record, each as its kind and a text of what was found and expected.

    Args:
        example: parsed record (see `records.parse`) in NumPy.
        split: its split, whose manifest prescribes the seed, the size, the lobe and all names.
    """
    out = [*_origin(example, split)]
    square = split.size, split.size
    sizes = dict.fromkeys(("image", "mask", "normal", *_LAYERS), square)
    out += _sizes(example, sizes | {"environment": STORED_SHAPE})
    if any(kind == "size" for kind, _ in out):
        return out
    for check in (_material, _camera, _layer_values, _mask):
        out += check(example)
    if any(kind in ("mask", "layer", "camera", "material") for kind, _ in out):
        # The checks below would only repeat such a fault.
        return out
    normals = [*_normals(example)]
    out += normals
    if (misfit := recomposition.misfit(example)) is not None:
        out.append(("recomposition", misfit))
    if not normals:
        out += _shading_sums(example, split.lobe)
    return out


def _origin(example: Mapping, split: Split) -> Iterator[tuple[str, str]]:
    if example["seed"] != split.seed:
        yield "seed", f"seed is {example['seed']}, expected the corpus' {split.seed}"
    for kind, allowed in (("shape", split.shapes), ("light", split.lights)):
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
    covered = np.flatnonzero(example["mask"])
    normal = pixels_at(example["normal"], covered)
    squared = np.einsum("ij,ij->i", normal, normal)
    wrong = ~(np.abs(squared - 1) <= 2 * (HALF_ROUNDING + FLOAT_ROUNDING) + HALF_ROUNDING**2)
    if wrong.any():
        worst = np.sqrt(squared[wrong][np.argmax(np.abs(squared[wrong] - 1))])
        yield "normal", f"{wrong.sum()} normals are not unit, one is {worst:.4g} long"
    behind = np.count_nonzero(np.einsum("ij,ij->i", normal, _views(example, covered)) <= 0)
    if behind:
        yield "normal", f"{behind} of {len(normal)} normals face away from the viewer"
    outside = np.flatnonzero(example["mask"] == 0)
    if stray := np.count_nonzero(pixels_at(example["normal"], outside).any(axis=-1)):
        yield "normal", f"normals are not 0 in {stray} pixels outside the mask"


def _views(example: Mapping, pixels: np.ndarray) -> np.ndarray:
    """Return the unit directions o to the viewer, `(N, 3)` float32, of some pixels."""
    views = shading.view_directions(example["camera"], *example["mask"].shape[:2])
    return pixels_at(views, pixels).astype(np.float32)


def _shading_sums(example: Mapping, lobe: str) -> Iterator[tuple[str, str]]:
    """Compare D and S of a few pixels with sums over the stored environment; yield the faults.

    The check finds a turned light, a flipped normal, a wrong exponent or a wrong normalisation. It
    needs some pixels in which the surface is flat, and is left out if there are too few.
    """
    probes = _probes(example)
    if len(probes) < _PROBES // 2:
        return
    normal = pixels_at(example["normal"], probes)
    view = _views(example, probes)
    exponent = float(example["shininess"])
    light = shading.texels(example["environment"][..., 0])
    factor = shading.lobe_factor(exponent, lobe)
    sums: tuple[tuple[str, Callable[[], np.ndarray], float], ...] = (
        ("diffuse_shading", lambda: shading.diffuse(normal, *light), _DIFFUSE_TOLERANCE),
        (
            "specular_shading",
            lambda: factor * shading.specular(normal, view, exponent, *light),
            _SPECULAR_TOLERANCE + _SPECULAR_BLUR * exponent,
        ),
    )
    for name, summed, tolerance in sums:
        stored = example[name].reshape(-1)[probes]
        # The stored light is coarse, so the tail of a lamp's highlight may be a little displaced.
        floor = max(_TAIL * float(example[name].max()), 1e-6)
        error = np.median(np.abs(stored - summed()) / np.maximum(stored, floor))
        if not error <= tolerance:
            yield (
                "shading",
                f"{name} is off by {error:.0%} (median of {len(probes)} pixels) from the sum over "
                f"the stored environment, expected at most {tolerance:.0%}: another light, "
                "exponent or normals",
            )


def _probes(example: Mapping) -> np.ndarray:
    """Return evenly spread pixels that are fully covered and in which the surface hardly bends."""
    size = len(example["mask"])
    inner = example["mask"][1:-1, 1:-1, 0] >= 1
    rows, columns = np.nonzero(inner)
    pixels = (rows + 1) * size + columns + 1
    pixels = _spread(pixels, _CANDIDATES_PER_PROBE * _PROBES)
    normal = example["normal"].reshape(-1, 3)
    neighbours = normal[pixels[:, None] + np.array([-size, -1, 1, size])]
    smooth = np.einsum("nkc,nc->nk", neighbours, normal[pixels]) > _SMOOTH
    return _spread(pixels[smooth.all(axis=-1)], _PROBES)


def _spread(values: np.ndarray, count: int) -> np.ndarray:
    """Return at most `count` of the values, evenly spaced."""
    if len(values) <= count:
        return values
    return values[np.linspace(0, len(values) - 1, count).astype(int)]


def _numbers(value: np.ndarray) -> str:
    return ", ".join(f"{number:g}" for number in np.atleast_1d(value))
