"""Whether a record's image is what its layers compose to: Eq. 4 in interval arithmetic.

The layers' rounding widens what is composed, the mask's what is blended, the image's what is
compared; nothing else may differ.
"""

from collections.abc import Mapping

import numpy as np

from lime_keras.data import records
from lime_keras.optics import colour
from lime_keras.optics.compositing import compose

HALF_ROUNDING = 2.0**-11
"""Largest relative error of a number rounded to half precision."""
FLOAT_ROUNDING = 2.0**-20
"""Of a dozen operations in single precision."""
_CODES = np.arange(256)
_HALF_CODE = 0.5 + 1e-3
"""Rounding to 8 bits, and the single precision of the sRGB curve before it, in codes."""

# A code stands for all that is rounded to it; the first and last also for all that is clipped.
_LOWEST = colour.srgb_to_linear((_CODES - _HALF_CODE) / 255).astype(np.float32)
_HIGHEST = colour.srgb_to_linear((_CODES + _HALF_CODE) / 255).astype(np.float32)
_LOWEST[0], _HIGHEST[-1] = -np.inf, np.inf


def misfit(example: Mapping) -> str | None:
    """What in a record's image is not Eq. 4 over a background in [0, 1], clipped; None if all is.

    Args:
        example: as `records.parse` gives it, in NumPy.
    """
    covered = covered_pixels(example)
    code = (pixels_at(example["image"], covered) * 255 + 0.5).astype(np.uint8)
    low, high = _blended(pixels_at(example["mask"], covered), *_composed(example, covered))
    darkest, brightest = _LOWEST[code], _HIGHEST[code]
    wrong = (low > brightest) | (high < darkest)
    if not wrong.any():
        return None
    miss = np.maximum(low - brightest, darkest - high)
    pixel, channel = np.unravel_index(np.argmax(miss), miss.shape)
    row, column = divmod(int(covered[pixel]), len(example["mask"]))
    bounds = [f"{_code(bound[pixel, channel]):.1f}" for bound in (low, high)]
    return (
        f"{np.count_nonzero(wrong.any(axis=-1))} of {len(code)} pixels are not m_a + m_d D + m_s S "
        f"over a background, worst at row {row}, column {column}, {'RGB'[channel]}: "
        f"{code[pixel, channel]} stored, expected {' … '.join(bounds)}"
    )


def _composed(example: Mapping, covered: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest radiance `(N, 3)` of Eq. 4 that the stored layers allow."""
    shadings = (example[name] for name in ("diffuse_shading", "specular_shading"))
    layers = [pixels_at(shading, covered)[None, None] for shading in shadings]
    material = [example[name] for name in ("diffuse_albedo", "specular_albedo", "ambient")]
    composed = compose(*material, *layers)[0, 0]
    # Halves below 2^-14 are rounded by at most 2^-25, in two layers of weights up to 1.
    error = composed * np.float32(HALF_ROUNDING + FLOAT_ROUNDING) + np.float32(2.0**-24)
    high = composed + error
    high[np.maximum(*layers)[0, 0, :, 0] >= records.LARGEST_HALF] = np.inf
    return composed - error, high


def _blended(
    coverage: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds once a background in [0, 1] shows through; `coverage` is `(N, 1)`, in 8 bits.

    Only coverages of 0 and 1 are stored exactly.
    """
    partial = np.flatnonzero(coverage < 1)
    slack = np.float32(0.5 / 255)
    shares, tops = coverage[partial], high[partial]
    low[partial] *= shares - slack
    high[partial] = 1 + np.where(tops > 1, shares + slack, shares - slack) * (tops - 1)
    return low, high


def covered_pixels(example: Mapping) -> np.ndarray:
    """Row-major indices `(N,)` of the pixels with any coverage."""
    return np.flatnonzero(example["mask"])


def pixels_at(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Values `(N, C)` of an image `(S, S, C)`: faster by index than by a mask."""
    return np.take(image.reshape(-1, image.shape[-1]), pixels, axis=0)


def _code(linear: float) -> float:
    """SRGB code, not rounded, of a linear radiance."""
    return 255 * float(colour.linear_to_srgb(np.clip(linear, 0, 1)))
