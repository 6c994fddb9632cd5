"""The camera law: which photos a consumer camera takes of a scene.

Light → exposure → defocus → noise → clipping → sRGB → 8 bits → JPEG. The constants and the ranges
of what is drawn for each photo stand here; photos are taken in `lime_keras.data.camera` (of stored
scenes, with TensorFlow) and in `lime_keras.synthesis.photograph` (of batches, on any device).
"""

import functools
from typing import Any

import numpy as np

from lime_keras.optics import colour

STOPS = 0.5
"""Largest deviation, up or down, of automatic exposure from the corpus' fixed one, in stops."""
CONFUSION = 1.5 / 256
"""Largest blur radius over image width, visible only close up: σ 0.8 / 256."""
FULL_WELL = 1_000.0, 30_000.0
"""Range of the electrons at white: a phone by lamplight, a large sensor by day."""
READ_NOISE = 2.0
"""Read noise in electrons, as in a present-day CMOS sensor.

With N electrons at white and r electrons of read noise, the variance of a radiance L is
(L + r²/N) / N. The square root of L + r²/N then has the variance 1/4N for every L. So the noise
is added to the root. Squaring adds 1/4N to the mean, which is subtracted again.
"""
QUALITY = 60.0, 98.0
"""Range of the JPEG quality: from what messengers send to what cameras store."""
NEVER_COMPRESSED = 0.2
"""Share of photos without JPEG: frames of a live video are not compressed."""

LIT = ("diffuse_shading", "specular_shading", "mirror", "ambient", "environment")
"""Features of a scene that the exposure multiplies; the albedos stay, so Eq. 4 still holds."""
SATURATED = np.float32(colour.srgb_to_linear(colour.CLIPPED))
"""Linear radiance from which on the sensor is saturated."""
GRAIN_ROWS, GRAIN_LENGTH = 4096, 64
"""Shape of the table of standard normal numbers; a photo's grain is rows drawn from it."""


def exposure(drawn: Any) -> Any:
    """Return the factor of the light, 2^−`STOPS` … 2^`STOPS`, of uniform numbers in [0, 1]."""
    return 2.0 ** (STOPS * (2.0 * drawn - 1.0))


def full_well(drawn: Any) -> Any:
    """Return the electrons at white, log-uniform in `FULL_WELL`, of uniform numbers in [0, 1]."""
    low, high = FULL_WELL
    return low * (high / low) ** drawn


def quality(drawn: Any) -> Any:
    """Return the JPEG quality in `QUALITY`, not rounded, of uniform numbers in [0, 1]."""
    low, high = QUALITY
    return low + (high - low) * drawn


@functools.cache
def grain_table() -> np.ndarray:
    """Return standard normal numbers, `(GRAIN_ROWS, GRAIN_LENGTH)` float32, always the same."""
    rng = np.random.default_rng(0)
    return rng.standard_normal((GRAIN_ROWS, GRAIN_LENGTH), np.float32)
