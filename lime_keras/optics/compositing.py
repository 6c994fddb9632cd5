"""Eq. 4: the image from its layers."""

from typing import Any

import numpy as np

from lime_keras.arrays import namespace

_BLACK = 1e-4
"""Square of an albedo below which a diffuse layer is noise."""


def compose(
    diffuse_albedo: Any,
    specular_albedo: Any,
    ambient: Any,
    diffuse_shading: Any,
    specular_shading: Any,
) -> Any:
    """Linear radiance I = m_a + m_d · D + m_s · S, not clipped.

    Args:
        diffuse_albedo: m_d, `(B, 3)`, linear, in [0, 1].
        specular_albedo: m_s, `(B,)` or `(B, 1)`, in [0, 1].
        ambient: m_a, `(B,)` or `(B, 1)`, radiance.
        diffuse_shading: D, `(B, H, W, 1)`, at least 0.
        specular_shading: S, `(B, H, W, 1)`, at least 0.

    Returns:
        `(B, H, W, 3)` radiance.
    """
    xp = namespace(diffuse_albedo, specular_albedo, ambient, diffuse_shading, specular_shading)
    m_d = xp.reshape(diffuse_albedo, (-1, 1, 1, 3))
    m_s = xp.reshape(specular_albedo, (-1, 1, 1, 1))
    m_a = xp.reshape(ambient, (-1, 1, 1, 1))
    return m_a + m_d * diffuse_shading + m_s * specular_shading


def diffuse_shading(diffuse_layer: np.ndarray, diffuse_albedo: np.ndarray) -> np.ndarray:
    """D `(H, W, 1)`, the grey shading with which m_d · D comes nearest a diffuse layer.

    Args:
        diffuse_layer: m_d · D, `(H, W, 3)` linear radiance.
        diffuse_albedo: m_d, `(3,)` linear; of a black one D cannot be known, and is NaN.
    """
    albedo = np.asarray(diffuse_albedo, diffuse_layer.dtype)
    square = float(albedo @ albedo)
    shade = diffuse_layer @ albedo / square if square > _BLACK else np.nan
    return np.broadcast_to(shade, diffuse_layer.shape[:2])[..., None]
