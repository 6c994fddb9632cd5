"""Checks of a single record, which every record of a corpus must pass.

Letters as in the paper: n normal, o direction to the viewer, D, S and M; m_d, m_s, s and m_a.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from lime_keras.data import records
from lime_keras.data.corpus import Split
from lime_keras.optics import colour, shading, shininess
from lime_keras.optics.compositing import compose
from lime_keras.optics.environment import STORED_SHAPE
from lime_keras.optics.material_law import AMBIENT

from ..scene.example import LEAST_COVERAGE

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
_HALF_ROUNDING = 2.0**-11  # largest relative error of a number rounded to half precision
_FLOAT_ROUNDING = 2.0**-20  # largest relative error of a dozen operations in single precision
_CODES = np.arange(256)
_HALF_CODE = 0.5 + 1e-3
"""Largest error of a code: rounding to 8 bits, and single precision in the sRGB curve."""

# Radiance bounds of each code. Codes 0 and 255 also represent all radiance that was clipped.
_LOWEST = colour.srgb_to_linear((_CODES - _HALF_CODE) / 255).astype(np.float32)
_HIGHEST = colour.srgb_to_linear((_CODES + _HALF_CODE) / 255).astype(np.float32)
_LOWEST[0], _HIGHEST[-1] = -np.inf, np.inf


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
    if (misfit := _misfit(example)) is not None:
        out.append(("recomposition", misfit))
    if not normals:
        out += _shading_sums(example, split.lobe)
    return out


def _misfit(example: Mapping) -> str | None:
    """Return how a record's image differs from its layers; None if it does not.

    The image must be Eq. 4 over some background in [0, 1], clipped to [0, 1], in interval
    arithmetic: the quantisation of the layers widens the interval of the composed radiance, that of
    the mask the blending with the background, and that of the image the comparison.
    """
    covered = np.flatnonzero(example["mask"])
    code = (_pixels_at(example["image"], covered) * 255 + 0.5).astype(np.uint8)
    coverage = _pixels_at(example["mask"], covered)
    # The background lies in [0, 1]. Of the coverage, of 8 bits, only 0 and 1 are exact.
    slack = np.where(coverage < 1, np.float32(0.5 / 255), np.float32(0))
    low, high = _composed(example, covered)
    low, above = low * (coverage - slack), high - 1
    high = 1 + np.where(above > 0, coverage + slack, coverage - slack) * above
    darkest, lightest = _LOWEST[code], _HIGHEST[code]
    wrong = (low > lightest) | (high < darkest)
    if not wrong.any():
        return None
    miss = np.maximum(low - lightest, darkest - high)
    pixel, channel = np.unravel_index(np.argmax(miss), miss.shape)
    row, column = divmod(int(covered[pixel]), len(example["mask"]))
    ends = np.clip([low[pixel, channel], high[pixel, channel]], 0, 1)
    bounds = [f"{255 * float(code):.1f}" for code in colour.linear_to_srgb(ends)]
    return (
        f"{np.count_nonzero(wrong.any(axis=-1))} of {len(code)} pixels are not m_a + m_d D + m_s S "
        f"over a background, worst at row {row}, column {column}, {'RGB'[channel]}: "
        f"{code[pixel, channel]} stored, expected {' … '.join(bounds)}"
    )


def _composed(example: Mapping, covered: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest radiance `(N, 3)` of Eq. 4 that the stored layers allow."""
    shadings = (example[name] for name in ("diffuse_shading", "specular_shading"))
    layers = [_pixels_at(shading, covered)[None, None] for shading in shadings]
    material = [example[name] for name in ("diffuse_albedo", "specular_albedo", "ambient")]
    composed = compose(*material, *layers)[0, 0]
    # Half floats below 2^-14 have errors of at most 2^-25, here in two layers of weight at most 1.
    error = composed * np.float32(_HALF_ROUNDING + _FLOAT_ROUNDING) + np.float32(2.0**-24)
    high = composed + error
    high[np.maximum(*layers)[0, 0, :, 0] >= records.LARGEST_HALF] = np.inf
    return composed - error, high


def _pixels_at(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return the values `(N, C)` of an image `(S, S, C)`; indices are faster than a mask."""
    return np.take(image.reshape(-1, image.shape[-1]), pixels, axis=0)


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
        slack = _FLOAT_ROUNDING * high
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
    normal = _pixels_at(example["normal"], covered)
    squared = np.einsum("ij,ij->i", normal, normal)
    wrong = ~(np.abs(squared - 1) <= 2 * (_HALF_ROUNDING + _FLOAT_ROUNDING) + _HALF_ROUNDING**2)
    if wrong.any():
        worst = np.sqrt(squared[wrong][np.argmax(np.abs(squared[wrong] - 1))])
        yield "normal", f"{wrong.sum()} normals are not unit, one is {worst:.4g} long"
    # Each normal faces the viewer at its sample, which may lie beside the pixel's centre.
    slack = max(0.6 / float(example["camera"][:2].min()) - 0.02, 0)
    behind = np.count_nonzero(np.einsum("ij,ij->i", normal, _views(example, covered)) <= -slack)
    if behind:
        yield "normal", f"{behind} of {len(normal)} normals face away from the viewer"
    outside = np.flatnonzero(example["mask"] == 0)
    if stray := np.count_nonzero(_pixels_at(example["normal"], outside).any(axis=-1)):
        yield "normal", f"normals are not 0 in {stray} pixels outside the mask"


def _views(example: Mapping, pixels: np.ndarray) -> np.ndarray:
    """Return the unit directions o to the viewer, `(N, 3)` float32, of some pixels."""
    views = shading.view_directions(example["camera"], *example["mask"].shape[:2])
    return _pixels_at(views, pixels).astype(np.float32)


def _shading_sums(example: Mapping, lobe: str) -> Iterator[tuple[str, str]]:
    """Compare D and S of a few pixels with sums over the stored environment; yield the faults.

    The check finds a turned light, a flipped normal, a wrong exponent or a wrong normalisation. It
    needs some pixels in which the surface is flat, and is left out if there are too few.
    """
    probes = _probes(example)
    if len(probes) < _PROBES // 2:
        return
    normal = _pixels_at(example["normal"], probes)
    view = _views(example, probes)
    exponent = float(example["shininess"])
    light = shading.texels(example["environment"][..., 0])
    factor = shading.lobe_factor(exponent, lobe)
    specular = factor * shading.specular(normal, view, exponent, *light)
    for name, summed, tolerance in (
        ("diffuse_shading", shading.diffuse(normal, *light), _DIFFUSE_TOLERANCE),
        ("specular_shading", specular, _SPECULAR_TOLERANCE + _SPECULAR_BLUR * exponent),
    ):
        stored = example[name].reshape(-1)[probes]
        # The stored light is coarse, so the tail of a lamp's highlight may be a little displaced.
        floor = max(_TAIL * float(example[name].max()), 1e-6)
        error = np.median(np.abs(stored - summed) / np.maximum(stored, floor))
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
