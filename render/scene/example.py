"""One training example: from a scene to the features of `lime_keras.data.records`."""

import numpy as np

from lime_keras.material import BlinnPhong
from lime_keras.optics import colour, environment
from lime_keras.optics.compositing import compose
from lime_keras.optics.shading import literal_scale

from . import integrals
from .gbuffer import GBuffer, Tracer
from .lights import Light
from .sampling import Pose

LEAST_COVERAGE = 0.02
"""Share of the image that an object must cover to be worth learning from."""


def render(
    tracer: Tracer,
    light: Light,
    pose: Pose,
    light_rotation: np.ndarray,
    material: BlinnPhong,
    background_srgb: np.ndarray,
    *,
    literal: bool = False,
) -> dict[str, np.ndarray | float]:
    """Every image and number of a record but its names (shape, light, seed and index).

    Args:
        tracer: of the mesh.
        light: the environment.
        pose: of the object, with the camera.
        light_rotation: `(3, 3)`, the map's frame to camera space.
        material: of the object.
        background_srgb: `(S, S, 3)` in [0, 1].
        literal: store D and S as Eqs. 2 and 3 are printed, without furnace normalisation, in an
            environment 1/π as bright, so that D keeps its size.

    Raises:
        ValueError: if the object covers less than `LEAST_COVERAGE` of the image.
    """
    gbuffer = tracer.trace(pose.rotation, pose.translation, pose.camera)
    coverage = gbuffer.coverage[..., None]
    if coverage.mean() < LEAST_COVERAGE:
        raise ValueError(f"the object covers {coverage.mean():.1%} of the image")
    diffuse, specular, mirror = layers(gbuffer, light, light_rotation, material.exponent)
    if literal:
        diffuse_factor, specular_factor = literal_scale(material.exponent)
        specular, mirror = specular * specular_factor / diffuse_factor, mirror / diffuse_factor
    composed = compose(
        material.diffuse_albedo,
        np.float32(material.specular_albedo),
        np.float32(material.ambient),
        diffuse[None],
        specular[None],
    )[0]
    background = colour.srgb_to_linear(background_srgb)
    # The sensor clips what a pixel has gathered, object and background together.
    linear = np.clip(coverage * composed + (1 - coverage) * background, 0, 1)
    stored_light = environment.rotate(light.coarse(), light_rotation, *environment.STORED_SHAPE)
    return {
        "image": np.clip(colour.linear_to_srgb(linear), 0, 1),
        "mask": coverage,
        "diffuse_shading": diffuse,
        "specular_shading": specular,
        "mirror": mirror,
        "normal": gbuffer.image(gbuffer.normal[gbuffer.central]),
        "camera": pose.camera,
        "environment": (stored_light / (np.pi if literal else 1))[..., None],
        "diffuse_albedo": material.diffuse_albedo,
        "specular_albedo": material.specular_albedo,
        "shininess": material.exponent,
        "ambient": material.ambient,
    }


def layers(
    gbuffer: GBuffer, light: Light, light_rotation: np.ndarray, exponent: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """D, S and M `(S, S, 1)`, furnace-normalised: means over what each pixel sees of the object."""
    to_map = light_rotation.astype(light.quality.precision)
    normal, view = gbuffer.normal @ to_map, gbuffer.view @ to_map
    diffuse = gbuffer.pixel_means(integrals.diffuse(normal, light))
    mirror = gbuffer.pixel_means(integrals.mirror(normal, view, light))
    chosen, weights = gbuffer.lobe_samples(light.quality.lobe_rough_above / (exponent + 2))
    blurred = integrals.specular(normal[chosen], view[chosen], exponent, light)
    specular = gbuffer.pixel_means(blurred, chosen, weights)
    return gbuffer.image(diffuse), gbuffer.image(specular), gbuffer.image(mirror)
