"""A check that a record's layers recompose to its image: Eq. 4 in interval arithmetic.

The quantisation of the layers widens the interval of the composed radiance; the quantisation of the
mask widens the blending with the background; the quantisation of the image widens the comparison.
No other difference is allowed.
"""

from collections.abc import Mapping

import numpy as np

from lime_keras.data import records
from lime_keras.optics import colour
from lime_keras.optics.compositing import compose

HALF_ROUNDING = 2.0**-11  # largest relative error of a number rounded to half precision
FLOAT_ROUNDING = 2.0**-20  # largest relative error of a dozen operations in single precision
_CODES = np.arange(256)
_HALF_CODE = 0.5 + 1e-3
"""Largest error of a code: rounding to 8 bits, and single precision in the sRGB curve."""

# Radiance bounds of each code. Codes 0 and 255 also represent all radiance that was clipped.
_LOWEST = colour.srgb_to_linear((_CODES - _HALF_CODE) / 255).astype(np.float32)
_HIGHEST = colour.srgb_to_linear((_CODES + _HALF_CODE) / 255).astype(np.float32)
_LOWEST[0], _HIGHEST[-1] = -np.inf, np.inf


def misfit(example: Mapping) -> str | None:
    """Return how a record's image differs from its layers; None if it does not.

    The image must be Eq. 4 over some background in [0, 1], clipped to [0, 1].

    Args:
        example: parsed record (see `records.parse`) in NumPy.
    """
    covered = np.flatnonzero(example["mask"])
    code = (pixels_at(example["image"], covered) * 255 + 0.5).astype(np.uint8)
    coverage = pixels_at(example["mask"], covered)
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
    layers = [pixels_at(shading, covered)[None, None] for shading in shadings]
    material = [example[name] for name in ("diffuse_albedo", "specular_albedo", "ambient")]
    composed = compose(*material, *layers)[0, 0]
    # Half floats below 2^-14 have errors of at most 2^-25, here in two layers of weight at most 1.
    error = composed * np.float32(HALF_ROUNDING + FLOAT_ROUNDING) + np.float32(2.0**-24)
    high = composed + error
    high[np.maximum(*layers)[0, 0, :, 0] >= records.LARGEST_HALF] = np.inf
    return composed - error, high


def pixels_at(image: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return the values `(N, C)` of an image `(S, S, C)`; indices are faster than a mask."""
    return np.take(image.reshape(-1, image.shape[-1]), pixels, axis=0)
