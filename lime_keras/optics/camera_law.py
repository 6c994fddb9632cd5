"""The camera law: which photos a consumer camera takes of a scene.

Light → exposure → defocus → white balance → noise → clipping → sRGB → 8 bits → JPEG. The constants
and the ranges of what is drawn for each photo stand here; photos are taken in
`lime_keras.data.camera`.
"""

import functools
from typing import Any

import numpy as np

from lime_keras.optics import colour
from lime_keras.optics.namespace import namespace

STOPS = 0.5
"""Largest deviation, up or down, of automatic exposure from the corpus' fixed one, in stops."""
CONFUSION = 1.5 / 256  # largest blur radius over image width, visible only close up: σ 0.8 / 256
FULL_WELL = 1_000.0, 30_000.0
"""Range of the electrons at white: a phone by lamplight, a large sensor by day."""
CAST, TINT, UNEVEN = 0.12, 0.04, 0.08
"""Largest errors of white balance: red over blue, green, and the change of the first over half the
image, in logarithms. Automatic white balance errs by some 5 %, and lamps differ across a room."""
READ_NOISE = 2.0
"""Read noise in electrons, as in a present-day CMOS sensor.

With N electrons at white and r electrons of read noise, the variance of a radiance L is
(L + r²/N) / N. The square root of L + r²/N then has the variance 1/4N for every L. So the noise
is added to the root. Squaring adds 1/4N to the mean, which is subtracted again.
"""
QUALITY = 60.0, 98.0  # range of the JPEG quality: from what messengers send to what cameras store
NEVER_COMPRESSED = 0.2  # share of photos without JPEG: frames of a live video are not compressed

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


def cast(drawn: Any) -> Any:
    """Return the colour cast of photos, `(…, 4)`, of uniform numbers in [0, 1] of this shape.

    It is the logarithm of red over blue, that of green, and the slope of the first to the right and
    down, over half the image.
    """
    return (2.0 * drawn - 1.0) * np.array([CAST, TINT, UNEVEN, UNEVEN], np.float32)


def places(size: int) -> np.ndarray:
    """Return the centres of the pixels of a row or column, `(size,)` float32, from −1 to 1."""
    return ((np.arange(size) + 0.5) * (2 / size) - 1).astype(np.float32)


def balance(cast: Any, place: Any, xp: Any = None) -> Any:
    """Return the gains of the channels of photos, `(B, S, S, 3)`; their logarithms sum to 0.

    Args:
        cast: `(B, 4)`, of `cast`; an array or a tensor.
        place: centres of the pixels of a row or column, `(S,)`, from −1 to 1 (`places`).
        xp: module to compute with, which has NumPy's function names; by default `numpy` for an
            array and `keras.ops` for a tensor.
    """
    xp = xp or namespace(cast)
    warm, green, right, down = (xp.reshape(cast[:, index], (-1, 1, 1)) for index in range(4))
    warm = 0.5 * (warm + right * place + down * place[:, None])
    green = 0.5 * green + 0 * warm
    return xp.exp(xp.stack([warm - green, 2 * green, -warm - green], axis=-1))


@functools.cache
def grain_table() -> np.ndarray:
    """Return standard normal numbers, `(GRAIN_ROWS, GRAIN_LENGTH)` float32, always the same."""
    rng = np.random.default_rng(0)
    return rng.standard_normal((GRAIN_ROWS, GRAIN_LENGTH), np.float32)
