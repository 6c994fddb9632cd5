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

_LEAST_SQUARE = 1e-14


def with_hue_of_pixels(diffuse_albedo: Any, image_srgb: Any, mask: Any) -> Any:
    """Return albedos turned to the hue of the object's pixels; grey part and saturation stay.

    An albedo stays as it is if the pixels are grey, if there are none, or if all are clipped. The
    arguments are NumPy arrays or Keras tensors.

    Args:
        diffuse_albedo: estimated m_d, linear RGB `(B, 3)` in [0, 1].
        image_srgb: photos `(B, H, W, 3)`, sRGB in [0, 1]; a pixel with a clipped channel, whose
            hue is false, does not count.
        mask: coverage of the object `(B, H, W, 1)` in [0, 1], the weight of each pixel.

    Returns:
        m_d, linear RGB `(B, 3)` in [0, 1]: cut off where the turned chroma leaves the cube.
    """
    xp = namespace(diffuse_albedo, image_srgb, mask)
    unclipped = xp.max(image_srgb, axis=-1, keepdims=True) < colour.CLIPPED
    weight = xp.where(unclipped, mask, np.float32(0))
    chroma = _chroma(colour.srgb_to_linear(image_srgb, xp), xp)
    total = xp.sum(weight, axis=(1, 2))
    mean = xp.sum(weight * chroma, axis=(1, 2)) / xp.maximum(total, np.float32(1))
    length = _length(mean, xp)
    own = _chroma(diffuse_albedo, xp)
    turned = diffuse_albedo - own + _length(own, xp) * mean / xp.maximum(length, _LEAST_CHROMA)
    return xp.where(length > _LEAST_CHROMA, xp.clip(turned, 0.0, 1.0), diffuse_albedo)


def _chroma(rgb: Any, xp: Any) -> Any:
    return rgb - xp.mean(rgb, axis=-1, keepdims=True)


def _length(vector: Any, xp: Any) -> Any:
    # At 0 the root has no gradient.
    return xp.sqrt(xp.maximum(xp.sum(xp.square(vector), axis=-1, keepdims=True), _LEAST_SQUARE))
