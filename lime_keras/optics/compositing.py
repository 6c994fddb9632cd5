"""The composition of an image from its layers (Eq. 4), and D from a diffuse layer."""

from typing import Any

import numpy as np

from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.optics.namespace import namespace

_BLACK = 1e-4
"""Squared length of m_d up to which it counts as black: its diffuse layer is only noise."""


def compose(
    diffuse_albedo: Any,
    specular_albedo: Any,
    ambient: Any,
    diffuse_shading: Any,
    specular_shading: Any,
) -> Any:
    """Return the linear radiance I = m_a + m_d · D + m_s · S (Eq. 4), not clipped.

    The arguments are NumPy arrays or Keras tensors. Shapes that do not fit raise an error of NumPy
    or of the backend.

    Args:
        diffuse_albedo: m_d, linear RGB `(B, 3)` in [0, 1].
        specular_albedo: m_s, `(B,)` or `(B, 1)` in [0, 1].
        ambient: m_a, linear radiance `(B,)` or `(B, 1)`, at least 0.
        diffuse_shading: D, linear radiance `(B, H, W, 1)`, at least 0.
        specular_shading: S, linear radiance `(B, H, W, 1)`, at least 0.

    Returns:
        Linear RGB radiance `(B, H, W, 3)`, at least 0.

    Example:
        A pixel with D = 0.5 and S = 2, of a reddish, slightly glossy material:

        >>> shade, gloss = np.full((1, 1, 1, 1), 0.5), np.full((1, 1, 1, 1), 2.0)
        >>> red, m_s, m_a = np.array([[0.8, 0.2, 0.2]]), np.array([0.1]), np.array([0.0])
        >>> compose(red, m_s, m_a, shade, gloss).round(3).tolist()
        [[[[0.6, 0.3, 0.3]]]]
    """
    xp = namespace(diffuse_albedo, specular_albedo, ambient, diffuse_shading, specular_shading)
    m_d = xp.reshape(diffuse_albedo, (-1, 1, 1, 3))
    m_s = xp.reshape(specular_albedo, (-1, 1, 1, 1))
    m_a = xp.reshape(ambient, (-1, 1, 1, 1))
    return m_a + m_d * diffuse_shading + m_s * specular_shading


def compose_image(
    material: BlinnPhong, diffuse_shading: np.ndarray, specular_shading: np.ndarray
) -> np.ndarray:
    """Return Eq. 4 of one image `(H, W, 3)`, not clipped, of D and S `(H, W, 1)` in NumPy."""
    m_s, m_a = np.float32(material.specular_albedo), np.float32(material.ambient)
    layers = diffuse_shading[None], specular_shading[None]
    return compose(material.diffuse_albedo, m_s, m_a, *layers)[0]


def diffuse_shading(diffuse_layer: np.ndarray, diffuse_albedo: np.ndarray) -> np.ndarray:
    """Return the grey shading D whose product m_d · D fits a diffuse layer best (least squares).

    Args:
        diffuse_layer: m_d · D, linear RGB radiance `(H, W, 3)`.
        diffuse_albedo: m_d, linear RGB `(3,)` in [0, 1].

    Returns:
        D, linear radiance `(H, W, 1)`. If m_d is black, D cannot be known and is NaN.
    """
    albedo = np.asarray(diffuse_albedo, diffuse_layer.dtype)
    square = float(albedo @ albedo)
    shade = diffuse_layer @ albedo / square if square > _BLACK else np.nan
    return np.broadcast_to(shade, diffuse_layer.shape[:2])[..., None]
