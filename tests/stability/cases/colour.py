"""Cases for sRGB, YUV and the compressed dynamic range at the ends of their ranges."""

import functools
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import colour, dynamic_range

from .. import curves
from ..precisions import ARRAYS, NUMPY_SINGLE, TENSORS, Precision

_LEVELS = {
    "-1": -1.0,
    "-0": -0.0,
    "0": 0.0,
    "1e-30": 1e-30,
    "0.0031308": 0.0031308,
    "just above 0.0031308": 0.0031308 * (1 + 2**-6),
    "0.04045": 0.04045,
    "just above 0.04045": 0.04045 * (1 + 2**-6),
    "1": 1.0,
    "10": 10.0,
    "1e8": 1e8,
    "NaN": np.nan,
    "infinity": np.inf,
}
_RADIANCES = {
    "-10000": -1e4,
    "-0": -0.0,
    "0": 0.0,
    "1e-30": 1e-30,
    "1e-8": 1e-8,
    "1": 1.0,
    "65504": 65504.0,
    "1e30": 1e30,
    "NaN": np.nan,
    "infinity": np.inf,
}
_COMPRESSED = {
    "-10000": -1e4,
    "0": 0.0,
    "1e-30": 1e-30,
    "1": 1.0,
    "the ceiling, 11": 11.0,
    "just below the ceiling": 11.0 * (1 - 2**-6),
    "just above the ceiling": 11.0 * (1 + 2**-6),
    "10000": 1e4,
    "NaN": np.nan,
    "infinity": np.inf,
}


def cases() -> list[Case]:
    """Return the cases of sRGB, compression and YUV."""
    precisions = (*TENSORS, NUMPY_SINGLE)
    # The lambdas look the functions up at run time, so that a test can replace them by broken ones.
    curved: list[tuple[str, Callable[[Any], Any], Callable[[Any], Any], dict[str, float]]] = [
        ("sRGB to linear", lambda x: colour.srgb_to_linear(x), _decoded, _LEVELS),
        ("linear to sRGB", lambda x: colour.linear_to_srgb(x), _encoded, _LEVELS),
        ("compress", lambda x: dynamic_range.compress(x), _compressed, _RADIANCES),
        ("expand", lambda x: dynamic_range.expand(x), _expanded, _COMPRESSED),
    ]
    out = []
    for part, curve, exact, points in curved:
        out += curves.cases(part, curve, exact, points, precisions)
    for precision in ARRAYS:
        for name, measure in (("RGB", _yuv_of_corners), ("YUV", _rgb_of_corners)):
            measure = functools.partial(measure, precision)
            out.append(Case("YUV", f"corners of the {name} cube", precision.name, measure))
        measure = functools.partial(_round_trip, precision)
        out.append(Case("YUV", "there and back, from the corners of RGB", precision.name, measure))
    return out


def _decoded(srgb: Any) -> Any:
    """Convert an sRGB value to linear radiance by IEC 61966-2-1."""
    if srgb <= mpmath.mpf("0.04045"):
        return srgb / mpmath.mpf("12.92")
    return ((srgb + mpmath.mpf("0.055")) / mpmath.mpf("1.055")) ** mpmath.mpf("2.4")


def _encoded(linear: Any) -> Any:
    """Convert linear radiance to an sRGB value by IEC 61966-2-1."""
    if linear <= mpmath.mpf("0.0031308"):
        return linear * mpmath.mpf("12.92")
    root = linear ** (1 / mpmath.mpf("2.4"))
    return mpmath.mpf("1.055") * root - mpmath.mpf("0.055")


def _compressed(linear: Any) -> Any:
    return mpmath.log1p(max(linear, mpmath.mpf(0)))


def _expanded(compressed: Any) -> Any:
    return mpmath.expm1(min(max(compressed, mpmath.mpf(0)), mpmath.mpf(11)))


def _yuv(rgb: Any) -> list[Any]:
    """Convert RGB to YUV by BT.601: luma Y, U = 0.492 (B − Y), V = 0.877 (R − Y)."""
    red, green, blue = map(mpmath.mpf, rgb)
    y = mpmath.mpf("0.299") * red + mpmath.mpf("0.587") * green + mpmath.mpf("0.114") * blue
    return [y, mpmath.mpf("0.492") * (blue - y), mpmath.mpf("0.877") * (red - y)]


def _rgb(yuv: Any) -> list[Any]:
    """Convert YUV to RGB by the inverse of `_yuv`, solved by hand."""
    y, u, v = map(mpmath.mpf, yuv)
    blue, red = u / mpmath.mpf("0.492") + y, v / mpmath.mpf("0.877") + y
    others = mpmath.mpf("0.299") * red + mpmath.mpf("0.114") * blue
    return [red, (y - others) / mpmath.mpf("0.587"), blue]


def _corners(low: Any, high: Any) -> np.ndarray:
    """Return the eight corners `(8, 3)` of a box."""
    chosen = np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(8, 3)
    return np.where(chosen > 0, high, low)


def _linear_map(
    found: Callable[[np.ndarray], np.ndarray],
    exact: Callable[[Any], list[Any]],
    corners: np.ndarray,
    precision: Precision,
) -> Outcome:
    """Compare a linear colour transform of corners with its exact formula."""
    value, _ = precision.evaluate(found, corners)
    rounded = precision.rounded(corners)
    with mpmath.workdps(50):
        right = np.array([[float(x) for x in exact(corner)] for corner in rounded])
    # The absolute values of a matrix row add up to 2.7 at most, and chrominance is below 0.7.
    return Outcome(Compared(value, right, right, precision.tolerance(3.0, terms=3)))


def _yuv_of_corners(precision: Precision) -> Outcome:
    return _linear_map(lambda x: colour.rgb_to_yuv(x), _yuv, _corners(0, 1), precision)


def _rgb_of_corners(precision: Precision) -> Outcome:
    corners = _corners(colour.YUV_LOW, colour.YUV_HIGH)
    return _linear_map(lambda x: colour.yuv_to_rgb(x), _rgb, corners, precision)


def _round_trip(precision: Precision) -> Outcome:
    def there_and_back(rgb: np.ndarray) -> np.ndarray:
        return colour.yuv_to_rgb(colour.rgb_to_yuv(rgb))

    return _linear_map(there_and_back, list, _corners(0, 1), precision)
