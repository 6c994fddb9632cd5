"""Conversions between sRGB and linear radiance, and between RGB and YUV.

The functions do not check their arguments: they raise only errors of NumPy or of the backend.
"""

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np

from lime_keras.optics.namespace import namespace

_KNEE_LINEAR = 0.0031308
_KNEE_SRGB = 0.04045

CLIPPED = 0.999  # sRGB level, in [0, 1], from which on a channel counts as clipped by the camera

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of linear R, G and B in the Rec. 709 luminance."""

# BT.601 analogue YUV, in which the paper draws the diffuse albedo (section 5.1).
_YUV_FROM_RGB = np.array(
    [
        [0.299, 0.587, 0.114],
        [-0.299 * 0.492, -0.587 * 0.492, 0.886 * 0.492],
        [0.701 * 0.877, -0.587 * 0.877, -0.114 * 0.877],
    ]
)
_RGB_FROM_YUV = np.linalg.inv(_YUV_FROM_RGB)
YUV_LOW = np.array([0.0, -0.886 * 0.492, -0.701 * 0.877])
YUV_HIGH = np.array([1.0, 0.886 * 0.492, 0.701 * 0.877])
"""Corners of the smallest box in YUV that holds the RGB cube [0, 1]³."""


_PART = 1 << 18
"""Number of an array's values that are converted at once; what lies between fits the cache."""


def srgb_to_linear(srgb: Any, xp: ModuleType | None = None) -> Any:
    """Decode sRGB to linear radiance (IEC 61966-2-1); [0, 1] becomes [0, 1].

    Values outside [0, 1] follow the curve's own extension (linear below 0, the power above 1), so
    the function is monotone everywhere and its gradient is finite.

    Args:
        srgb: sRGB values of any shape, array or tensor.
        xp: module to compute with, which has NumPy's function names; by default `numpy` for an
            array and `keras.ops` for a tensor.

    Returns:
        Linear radiance of the same shape.

    Example:
        >>> round(float(srgb_to_linear(0.5)), 4)
        0.214
    """
    xp = xp or namespace(srgb)

    def decode(values: Any) -> Any:
        high = ((xp.maximum(values, _KNEE_SRGB) + 0.055) / 1.055) ** 2.4
        return xp.where(values <= _KNEE_SRGB, values / 12.92, high)

    return _in_parts(decode, srgb)


def linear_to_srgb(linear: Any, xp: ModuleType | None = None) -> Any:
    """Encode linear radiance as sRGB; the inverse of `srgb_to_linear`.

    Radiance above 1 is not clipped: it becomes sRGB values above 1.

    Args:
        linear: linear radiance of any shape, array or tensor.
        xp: module to compute with (see `srgb_to_linear`).

    Returns:
        sRGB values of the same shape.

    Example:
        >>> round(float(linear_to_srgb(srgb_to_linear(0.5))), 6)
        0.5
    """
    xp = xp or namespace(linear)

    def encode(values: Any) -> Any:
        high = 1.055 * xp.maximum(values, _KNEE_LINEAR) ** (1.0 / 2.4) - 0.055
        return xp.where(values <= _KNEE_LINEAR, values * 12.92, high)

    return _in_parts(encode, linear)


def _in_parts(curve: Callable[[Any], Any], values: Any) -> Any:
    """Return a curve of each value; a large float array is converted part by part."""
    if (
        not isinstance(values, np.ndarray)
        or values.size <= _PART
        or not np.issubdtype(values.dtype, np.floating)
    ):
        return curve(values)
    flat = values.reshape(-1)
    out = np.empty_like(flat)
    for start in range(0, flat.size, _PART):
        part = slice(start, start + _PART)
        out[part] = curve(flat[part])
    return out.reshape(values.shape)


LEVELS = srgb_to_linear(np.arange(256) / 255).astype(np.float32)  # of 8 bits, linear, `(256,)`


def brightest(rgb: np.ndarray) -> np.ndarray:
    """Return the largest channel `(...)` of RGB `(..., 3)`, ten times as fast as `max` does."""
    return np.maximum(np.maximum(rgb[..., 0], rgb[..., 1]), rgb[..., 2])


def grey(rgb: np.ndarray) -> np.ndarray:
    """Return the mean of the channels `(...)` of RGB `(..., 3)`, to the bit that of `mean`."""
    return (rgb[..., 0] + rgb[..., 1] + rgb[..., 2]) / rgb.dtype.type(3)


def luminance(rgb_linear: np.ndarray) -> np.ndarray:
    """Return the Rec. 709 luminance `(...)` of linear RGB `(..., 3)`, in the unit of the RGB."""
    return rgb_linear @ LUMINANCE_WEIGHTS.astype(rgb_linear.dtype)


def rgb_to_yuv(rgb: np.ndarray) -> np.ndarray:
    """Return BT.601 YUV `(..., 3)`, from `YUV_LOW` to `YUV_HIGH`, of RGB `(..., 3)` in [0, 1]."""
    return rgb @ _YUV_FROM_RGB.T


def yuv_to_rgb(yuv: np.ndarray) -> np.ndarray:
    """Return RGB `(..., 3)` of BT.601 YUV `(..., 3)`.

    The RGB may lie outside [0, 1]; the caller rejects or clips it.
    """
    return yuv @ _RGB_FROM_YUV.T
