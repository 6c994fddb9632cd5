"""The pictures of one example in a report: its layers and its renderings, as sRGB images."""

import io
from dataclasses import dataclass

import numpy as np
from matplotlib import image as png_writer

from lime_keras.optics import colour, shading
from lime_keras.optics.compositing import compose
from lime_keras.optics.reflectance_map import disc, true_reflectance_map

from ..accuracy.tone import coloured, tonemap, white_point
from .examples import Example

_LAYERS = {"specular_shading": "Specular shading S", "mirror": "Mirror image M"}


@dataclass(frozen=True)
class Pair:
    """A true picture and its estimate, `(H, W, 3)` each, sRGB in [0, 1], with their title."""

    title: str
    truth: np.ndarray
    estimate: np.ndarray


def pairs(example: Example) -> list[Pair]:
    """Return the mask, the layers that the system estimates, and the rendering as pairs."""
    truth, estimate = example.truth, example.estimate
    layers = [
        _hdr_pair(title, truth[name], estimate[name], truth["mask"])
        for name, title in _LAYERS.items()
        if name in estimate
    ]
    if "reflectance_map" in estimate:
        sphere = disc(len(truth["mask"]))
        batch = {name: np.asarray(value)[None] for name, value in truth.items()}
        true = np.asarray(true_reflectance_map(batch))[0]
        found = estimate["reflectance_map"]
        layers.append(_hdr_pair("Reflectance map", true, found, sphere))
    return [
        Pair("Mask", coloured(truth["mask"]), coloured(estimate["mask"])),
        *layers,
        Pair("Rendered with the material", true_render(example), estimated_render(example)),
    ]


def true_render(example: Example) -> np.ndarray:
    """Render Eq. 4 with the true material and layers over the photo's background.

    Returns:
        `(H, W, 3)` sRGB in [0, 1].
    """
    truth = example.truth
    return _over_background(
        truth, truth["diffuse_albedo"], truth["specular_albedo"], truth["specular_shading"]
    )


def estimated_render(example: Example) -> np.ndarray:
    """Render Eq. 4 with the estimated m_d, m_s and s under the true light, on the true shape.

    S is computed from the record's environment with the estimated exponent. D, m_a and the mask
    are the true ones, so only the material differs from `true_render`.

    Returns:
        `(H, W, 3)` sRGB in [0, 1].
    """
    truth, estimate = example.truth, example.estimate
    shape = truth["mask"].shape
    inside = truth["mask"][..., 0] > 0
    view = shading.view_directions(truth["camera"], *shape[:2]).astype(np.float32)
    specular = np.zeros(shape, np.float32)
    light, energy = shading.texels(truth["environment"][..., 0])
    specular[inside, 0] = shading.specular(
        truth["normal"][inside], view[inside], example.exponent, light, energy
    )
    specular *= np.float32(shading.lobe_factor(example.exponent, example.lobe))
    return _over_background(
        truth, estimate["diffuse_albedo"], estimate["specular_albedo"], specular
    )


def png(image_srgb: np.ndarray) -> bytes:
    """Return the PNG of an image `(H, W, 3)`, sRGB in [0, 1]."""
    buffer = io.BytesIO()
    png_writer.imsave(buffer, np.clip(image_srgb, 0.0, 1.0), format="png")
    return buffer.getvalue()


def _hdr_pair(title: str, true: np.ndarray, found: np.ndarray, mask: np.ndarray) -> Pair:
    """Tone-map a true layer and its estimate by one white point, the truth's 99th percentile."""
    true = true * mask
    white = white_point(true, mask)
    return Pair(title, tonemap(true, white), tonemap(found, white))


def _over_background(
    truth: dict[str, np.ndarray],
    diffuse_albedo: np.ndarray,
    specular_albedo: np.ndarray,
    specular_shading: np.ndarray,
) -> np.ndarray:
    """Render the object by Eq. 4, clip it at 1 as a camera does, and put it over the background."""
    radiance = compose(
        diffuse_albedo,
        np.asarray(specular_albedo),
        truth["ambient"],
        truth["diffuse_shading"][None],
        specular_shading[None],
    )[0]
    photo = colour.srgb_to_linear(truth["image"])
    mask = truth["mask"]
    mixed = np.clip(radiance, 0.0, 1.0) * mask + photo * (1 - mask)
    return np.clip(colour.linear_to_srgb(mixed), 0.0, 1.0)
