"""The relighting error: the object rendered with the estimated and with the true material.

The object is rendered by Eq. 4 under two lights: that of its photo, and a light that no corpus
holds. As in a camera, the result is clipped at 1 and encoded as sRGB. Only the material differs,
so its errors count as far as they are visible: the exponent matters where there is a highlight.
"""

import math
from collections.abc import Sequence

import numpy as np

from lime_keras.optics import colour, shading, shininess, studio_light
from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.optics.compositing import compose
from lime_keras.runtime.engine import Arrays

_SOFT_BOXES = (
    ((-0.6, 0.6, 0.55), 22.0, 4.5),
    ((0.9, 0.1, 0.35), 16.0, 2.5),
    ((0.1, 0.9, -0.5), 18.0, 4.5),
)
"""The light not seen (`studio_light.LIGHTS`), the same for all figures in docs/results.md."""
PIXELS = 128
"""Number of pixels rendered of an object, evenly spaced in reading order. With all 5,000 pixels the
mean over 1,000 images changes by less than 0.05 dB (docs/explanation/decisions.md)."""
HIGHEST_PSNR = 10 * math.log10(12 * 255**2)
"""PSNR of quantisation to 8 bits, 58.9 dB; a higher PSNR is no visible improvement."""

FEATURES = (
    "mask",
    "normal",
    "camera",
    "environment",
    "diffuse_albedo",
    "specular_albedo",
    "shininess",
    "ambient",
)
"""Names of the record's features that relighting needs."""


AVERAGE = BlinnPhong(
    np.full(3, 0.5, np.float32), 0.5, 10.0 ** ((shininess.LOG_LOW + shininess.LOG_HIGH) / 2)
)
"""The material in the middle of every range: a prediction that ignores the image."""


class Lit:
    """A sample of the pixels of one object under one light, to be rendered with any material.

    Args:
        example: record, resized to the model's size, with `mask`, `normal`, `camera`, `ambient`.
        radiance: radiance of the light `(H, W)` in camera space.
        lobe: lobe of the materials, one of `corpus.LOBES`.
    """

    def __init__(self, example: Arrays, radiance: np.ndarray, lobe: str = "furnace"):
        self._lobe = lobe
        rows, columns = _pixels(example["mask"][..., 0])
        view = shading.view_directions(example["camera"], *example["mask"].shape[:2])
        self._normal = example["normal"][rows, columns].astype(np.float32)
        self._view = view[rows, columns].astype(np.float32)
        self._light = shading.texels(radiance.astype(np.float32))
        self._ambient = np.asarray(example["ambient"])
        self._diffuse = shading.diffuse(self._normal, *self._light)

    def photo(self, material: BlinnPhong) -> np.ndarray:
        """Render the pixels with a material by Eq. 4, `(P, 3)` sRGB in [0, 1]."""
        specular = shading.specular(self._normal, self._view, material.exponent, *self._light)
        specular *= np.float32(shading.lobe_factor(material.exponent, self._lobe))
        radiance = compose(
            material.diffuse_albedo,
            np.asarray(material.specular_albedo),
            self._ambient,
            self._diffuse[None, :, None, None],
            specular[None, :, None, None],
        )[0, :, 0]
        return colour.linear_to_srgb(np.clip(radiance, 0.0, 1.0))


def psnr(true: np.ndarray, estimated: np.ndarray) -> float:
    """Compute the PSNR in decibel of two images in [0, 1], at most `HIGHEST_PSNR`.

    Images without pixels have `HIGHEST_PSNR`.
    """
    error = float(np.mean(np.square(np.float64(true) - estimated))) if true.size else 0.0
    return min(HIGHEST_PSNR, -10 * math.log10(error)) if error > 0 else HIGHEST_PSNR


def relight(
    example: Arrays, materials: Sequence[BlinnPhong], lobe: str = "furnace"
) -> list[list[float]]:
    """Compute the PSNR in decibel of each material under the two lights.

    Args:
        example: record, resized to the model's size, with `FEATURES`.
        materials: materials to be compared with the true one.
        lobe: lobe of the record and of the materials, one of `corpus.LOBES`.

    Returns:
        Of each material the PSNR under the light of the photo, and under `_SOFT_BOXES`.
    """
    truth = BlinnPhong(
        example["diffuse_albedo"], float(example["specular_albedo"]), float(example["shininess"])
    )
    lights = example["environment"][..., 0], studio_light.light(_SOFT_BOXES)
    lit = [Lit(example, radiance, lobe) for radiance in lights]
    true = [one.photo(truth) for one in lit]
    return [
        [psnr(right, one.photo(material)) for one, right in zip(lit, true, strict=True)]
        for material in materials
    ]


def _pixels(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of at most `PIXELS` pixels of a mask `(H, W)`: fully covered ones.

    Where there is none, as of a thin object in a small image, they are partly covered.
    """
    full = mask >= 1.0
    rows, columns = np.nonzero(full if full.any() else mask > 0.0)
    chosen = np.linspace(0, len(rows) - 1, min(PIXELS, len(rows))).round().astype(int)
    return rows[chosen], columns[chosen]
