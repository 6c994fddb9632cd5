"""Rendering of a scene to a training example, with the features of `lime_keras.data.records`."""

from typing import Any

import numpy as np

from lime_keras.optics import colour, environment, shading
from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.optics.compositing import compose_image

from . import integrals
from .gbuffer import GBuffer, Tracer
from .lights import Light
from .sampling import Pose

LEAST_COVERAGE = 0.02
"""Least share of the image that an object must cover; smaller objects teach a network little."""


def render(
    tracer: Tracer,
    light: Light,
    pose: Pose,
    light_rotation: np.ndarray,
    material: BlinnPhong,
    background_srgb: np.ndarray,
    *,
    lobe: str = "furnace",
) -> dict[str, Any]:
    """Render the images and numbers of a record, all features but shape, light, seed and index.

    Args:
        tracer: tracer of the object's mesh.
        light: environment map that lights the object.
        pose: pose of the object, with the camera.
        light_rotation: rotation `(3, 3)` from the map's frame to camera space.
        material: material of the object.
        background_srgb: background, `(S, S, 3)` sRGB in [0, 1].
        lobe: one of `corpus.LOBES`; it decides the scale of S, and so the unit of m_s.

    Returns:
        The features by name, as in `lime_keras.data.records`.

    Raises:
        ValueError: if the object covers less than `LEAST_COVERAGE` of the image.
    """
    gbuffer = tracer.trace(pose.rotation, pose.translation, pose.camera)
    coverage = gbuffer.coverage[..., None]
    if coverage.mean() < LEAST_COVERAGE:
        raise ValueError(f"the object covers {coverage.mean():.1%} of the image")
    diffuse, specular, mirror = layers(gbuffer, light, light_rotation, material.exponent)
    specular *= np.float32(shading.lobe_factor(material.exponent, lobe))
    stored = environment.rotate(light.coarse(), light_rotation, *environment.STORED_SHAPE)
    composed = compose_image(material, diffuse, specular)
    background = colour.srgb_to_linear(background_srgb)
    # The sensor clips the sum of object and background in each pixel.
    linear = np.clip(coverage * composed + (1 - coverage) * background, 0, 1)
    return {
        "image": np.clip(colour.linear_to_srgb(linear), 0, 1),
        "mask": coverage,
        "diffuse_shading": diffuse,
        "specular_shading": specular,
        "mirror": mirror,
        "environment": stored[..., None],
        "normal": gbuffer.image(gbuffer.normal[gbuffer.central]),
        "camera": pose.camera,
        "diffuse_albedo": material.diffuse_albedo,
        "specular_albedo": material.specular_albedo,
        "shininess": material.exponent,
        "ambient": material.ambient,
    }


def layers(
    gbuffer: GBuffer, light: Light, light_rotation: np.ndarray, exponent: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Compute D, S and M, each `(S, S, 1)`, furnace-normalised.

    The values are means over the part of the object that each pixel sees.

    Args:
        gbuffer: samples of the image.
        light: environment map in its own frame.
        light_rotation: rotation `(3, 3)` from the map's frame to camera space.
        exponent: s.
    """
    to_map = light_rotation.astype(light.quality.precision)
    normal, view = gbuffer.normal @ to_map, gbuffer.view @ to_map
    diffuse = gbuffer.pixel_means(integrals.diffuse(normal, light))
    mirror = gbuffer.pixel_means(integrals.mirror(normal, view, light, gbuffer.mirror_spacing()))
    chosen, weights = gbuffer.lobe_samples(light.quality.lobe_rough_above / (exponent + 2))
    blurred = integrals.specular(normal[chosen], view[chosen], exponent, light)
    specular = gbuffer.pixel_means(blurred, chosen, weights)
    return gbuffer.image(diffuse), gbuffer.image(specular), gbuffer.image(mirror)
