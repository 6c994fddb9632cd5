"""sRGB and linear radiance, RGB and YUV. The only place that knows 0.0031308."""

from types import ModuleType
from typing import Any

import numpy as np

from lime_keras.arrays import namespace

_KNEE_LINEAR = 0.0031308
_KNEE_SRGB = 0.04045

CLIPPED = 0.999
"""sRGB level from which a channel counts as clipped by the camera."""

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Rec. 709 luminance of linear RGB."""

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
"""The smallest box in YUV that holds the RGB cube."""


def srgb_to_linear(srgb: Any, xp: ModuleType | None = None) -> Any:
    """Decode sRGB to linear radiance (IEC 61966-2-1), any shape.

    Values outside [0, 1] follow the curve's own extension (linear below 0, the power above 1), so
    the function is monotone everywhere and its gradient is finite.

    Args:
        srgb: array or tensor.
        xp: module with NumPy's names to compute with; by default that of the argument.
    """
    xp = xp or namespace(srgb)
    high = ((xp.maximum(srgb, _KNEE_SRGB) + 0.055) / 1.055) ** 2.4
    return xp.where(srgb <= _KNEE_SRGB, srgb / 12.92, high)


def linear_to_srgb(linear: Any, xp: ModuleType | None = None) -> Any:
    """Encode linear radiance as sRGB; the inverse of `srgb_to_linear`. Does not clip."""
    xp = xp or namespace(linear)
    high = 1.055 * xp.maximum(linear, _KNEE_LINEAR) ** (1.0 / 2.4) - 0.055
    return xp.where(linear <= _KNEE_LINEAR, linear * 12.92, high)


def luminance(rgb_linear: np.ndarray) -> np.ndarray:
    """Rec. 709 luminance of linear RGB `(..., 3)`, shape `(...)`."""
    return rgb_linear @ LUMINANCE_WEIGHTS.astype(rgb_linear.dtype)


def rgb_to_yuv(rgb: np.ndarray) -> np.ndarray:
    """BT.601 YUV of RGB `(..., 3)`."""
    return rgb @ _YUV_FROM_RGB.T


def yuv_to_rgb(yuv: np.ndarray) -> np.ndarray:
    """RGB of BT.601 YUV `(..., 3)`; may leave [0, 1], which the caller rejects or clips."""
    return yuv @ _RGB_FROM_YUV.T
