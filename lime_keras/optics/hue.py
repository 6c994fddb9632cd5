"""The hue that an object's pixels show, which is that of its diffuse albedo.

By Eq. 4, in grey light, every pixel of an object is m_a + m_d · D + m_s · S, where all but m_d is
grey. So the pixels' chroma, the part of a colour that is left when its mean over R, G and B is
taken away, is D times that of m_d: its direction needs no estimate.
"""

from typing import Any

import numpy as np

from lime_keras.arrays import namespace
from lime_keras.optics import colour

_LEAST_CHROMA = 1e-3
"""Least chroma, linear radiance, over which a mean has a direction: a quarter of an 8-bit level."""
_LEAST_SQUARE = 1e-20


def with_hue_of_pixels(diffuse_albedo: Any, masked_image: Any) -> Any:
    """Return albedos turned to the hue of the object's pixels; grey part and saturation stay.

    An albedo stays as it is if the pixels are grey, if there are none, or if all are clipped. The
    arguments are NumPy arrays or Keras tensors.

    Args:
        diffuse_albedo: estimated m_d, linear RGB `(B, 3)`, finite.
        masked_image: photos times the object's coverage `(B, H, W, 3)`, sRGB in [0, 1]; a pixel
            with a clipped channel, whose hue is false, does not count.

    Returns:
        m_d, linear RGB `(B, 3)`. The turned chroma may leave the range of the albedo.
    """
    xp = namespace(diffuse_albedo, masked_image)
    brightest = xp.max(masked_image, axis=-1, keepdims=True)
    usable = xp.logical_and(brightest > 0, brightest < colour.CLIPPED)
    linear = colour.srgb_to_linear(masked_image, xp)
    chroma = xp.where(usable, _chroma(linear, xp), np.float32(0))
    # float32 counts the pixels of 4096 × 4096 exactly.
    count = xp.sum(xp.where(usable, np.float32(1), np.float32(0)), axis=(1, 2))
    mean = xp.sum(chroma, axis=(1, 2)) / xp.maximum(count, np.float32(1))
    length = _length(mean, xp)
    own = _chroma(diffuse_albedo, xp)
    turned = diffuse_albedo - own + _length(own, xp) * mean / xp.maximum(length, _LEAST_CHROMA)
    return xp.where(length > _LEAST_CHROMA, turned, diffuse_albedo)


def _chroma(rgb: Any, xp: Any) -> Any:
    return rgb - xp.mean(rgb, axis=-1, keepdims=True)


def _length(vector: Any, xp: Any) -> Any:
    # At 0 the root has no gradient.
    return xp.sqrt(xp.maximum(xp.sum(xp.square(vector), axis=-1, keepdims=True), _LEAST_SQUARE))
