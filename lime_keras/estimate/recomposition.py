"""The parts of a photo by the estimate: its diffuse part, and Eq. 4 of the fit."""

from collections.abc import Iterator

import numpy as np

from lime_keras.estimate import framing
from lime_keras.material import Material
from lime_keras.optics import colour, compositing, highlights

_PIXELS_AT_ONCE = 1 << 18  # number of pixels of a photo, about, whose layers are computed at once


def diffuse(
    image_srgb: np.ndarray, mask: np.ndarray, shading: np.ndarray, material: Material
) -> np.ndarray:
    """Return the diffuse part of a photo, m_d · D of Eq. 4: what the highlights leave.

    Args:
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        mask: coverage of the object `(H, W, 1)` in [0, 1].
        shading: S, linear radiance `(H, W, 1)`, 0 outside the mask.
        material: estimate with the specular albedo.

    Returns:
        Linear radiance `(H, W, 3)` float32, at least 0, 0 outside the mask.
    """
    specular_albedo = np.array([material.specular_albedo], np.float32)
    out = np.empty(image_srgb.shape, np.float32)
    hidden = np.empty(image_srgb.shape[:2], bool)
    for part in _parts(mask):
        specular = specular_albedo * shading[part]
        linear = colour.srgb_to_linear(image_srgb[part])
        out[part] = np.maximum(linear - specular, 0) * mask[part]
        hidden[part] = highlights.hidden(image_srgb[part], specular)
    # Where they leave nothing that can be read, what is around; never more than is seen.
    inside = mask[..., 0] >= framing.THRESHOLD
    hidden &= inside
    if hidden.any():
        likely = highlights.inpainted(out, inside & ~hidden, hidden)
        visible = colour.srgb_to_linear(image_srgb[hidden]) * mask[hidden]
        out[hidden] = np.minimum(likely, visible)
    return out


def recompose(
    diffuse_part: np.ndarray, mask: np.ndarray, shading: np.ndarray, material: Material
) -> np.ndarray:
    """Return Eq. 4 of the fit: the grey shading that fits the diffuse part, and the highlights.

    Args:
        diffuse_part: what `diffuse` returned, linear radiance `(H, W, 3)`.
        mask: coverage of the object `(H, W, 1)` in [0, 1].
        shading: S, linear radiance `(H, W, 1)`, 0 outside the mask.
        material: estimate with both albedos.

    Returns:
        Linear radiance `(H, W, 3)` float32, at least 0.
    """
    specular_albedo = np.array([material.specular_albedo], np.float32)
    out = np.empty(diffuse_part.shape, np.float32)
    diffuse_albedo = np.asarray(material.diffuse_albedo)
    for part in _parts(mask):
        # The D of a black material is NaN. It does not matter: m_d · D is 0 for every D.
        shade = np.nan_to_num(compositing.diffuse_shading(diffuse_part[part], diffuse_albedo))
        out[part] = shade * diffuse_albedo + specular_albedo * shading[part] * mask[part]
    return out


def _parts(mask: np.ndarray) -> Iterator[slice]:
    """Yield rows: a large photo's intermediate images would take more memory than its layers."""
    height = max(1, _PIXELS_AT_ONCE // mask.shape[1])
    for top in range(0, len(mask), height):
        yield slice(top, top + height)
