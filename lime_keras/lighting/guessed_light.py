"""The light of a photo whose normals are guessed from the mask (section 7).

Guessed normals are off by tens of degrees, so M and D are gathered in wrong directions: lamps and
shadows average out, and the light of `illumination.estimate` is dull. Two properties of the photo
do not depend on the normals and correct this: the energy of the highlights, and how much the
object's brightness varies.
"""

import dataclasses

import numpy as np

from lime_keras.lighting import guessed_normals, illumination
from lime_keras.material import Material
from lime_keras.optics import colour, environment, highlights, shading

_SHARPNESS = 8.0
"""Power that turns a light into lamps: what is half as bright becomes 256 times darker.

Of 4 and 8, by the spheres of ten photographs: with 4 a white glazed fox has no clear highlight.
"""
_MOST_LAMPS = 0.8  # largest share of the object's mean brightness that the lamps may give
_NORMALS = 128  # number of normals at which the object is shaded
_SHAPE = (32, 64)  # rows and columns of the light that shades it


def estimate(
    image_srgb: np.ndarray, material: Material, camera: np.ndarray | None = None
) -> np.ndarray:
    """Estimate the light in camera space, linear radiance `(64, 128)`, at least 0.

    Args:
        image_srgb: picture `(H, W, 3)`, sRGB in [0, 1].
        material: whole estimate from it, with the layers `mask`, `specular_shading`, `mirror` and
            `diffuse` at the picture's size.
        camera: fx, fy, cx, cy in pixels; by default `shading.assumed_camera`.

    Raises:
        ValueError: if the material lacks a number or a layer, or no pixel shows the light.
    """
    layers = material.layers
    lacking = sorted({"mask", "specular_shading", "mirror", "diffuse"} - set(layers))
    whole = material.whole()
    if lacking or whole is None:
        raise ValueError(
            f"the material lacks {', '.join(lacking) or 'a number'}: estimate it whole"
        )
    # M is nowhere below S on the average: S is M, blurred. MirrorNet makes lamps too weak.
    mirror = np.maximum(layers["mirror"], layers["specular_shading"])
    specular = whole.specular_albedo * layers["specular_shading"]
    hidden = highlights.hidden(image_srgb, specular)[..., None]
    diffuse = np.where(hidden, np.nan, layers["diffuse"])
    observed = dataclasses.replace(material, layers=layers | {"mirror": mirror, "diffuse": diffuse})
    normal = guessed_normals.normals(layers["mask"])
    light = illumination.estimate(illumination.from_material(observed, normal, camera))
    inside = layers["mask"][..., 0] >= 0.5
    brightness = colour.grey(colour.srgb_to_linear(image_srgb[inside]))
    return with_contrast(light, normal[inside], brightness, material)


def with_contrast(
    light: np.ndarray, normal: np.ndarray, brightness: np.ndarray, material: Material
) -> np.ndarray:
    """Return a light under which an object is as bright, and varies as much, as in the photo.

    The light is mixed with lamps, which are its own brightest directions. Both give the object the
    same mean brightness, that of the photo; the share of the lamps is the least that makes the
    variance that of the photo, if there is one.

    Args:
        light: linear radiance `(64, 128)` in camera space, at least 0.
        normal: normals of the object's pixels, unit, `(N, 3)` in camera space.
        brightness: mean of R, G and B of the same pixels, linear radiance `(N,)`.
        material: complete estimate.

    Returns:
        Light `(64, 128)`; the given one if it does not light the object, or the object is black.
    """
    whole = material.whole()
    if whole is None or not len(normal):
        return light
    lamps = (light / max(float(light.max()), 1e-30)) ** _SHARPNESS
    picked = normal[((np.arange(_NORMALS) + 0.5) * len(normal) / _NORMALS).astype(np.int64)]
    even, peaked = _shaded(np.stack([light, lamps]), picked, whole.exponent) @ np.array(
        [np.mean(whole.diffuse_albedo), whole.specular_albedo]
    )
    mean = float(np.mean(brightness, dtype=np.float64))
    if not (even.mean() > 0 and peaked.mean() > 0 and mean > 0):
        return light
    even_gain, lamp_gain = mean / even.mean(), mean / peaked.mean()
    share = _share(
        even * even_gain, peaked * lamp_gain, float(np.var(brightness, dtype=np.float64))
    )
    return (1 - share) * even_gain * light + share * lamp_gain * lamps


def _share(even: np.ndarray, peaked: np.ndarray, variance: float) -> float:
    """Return the least w in [0, 0.8] for which (1 − w) · even + w · peaked has a variance.

    The variance is a parabola in w; where it stays below what is wanted, w is 0.8.
    """
    step = peaked - even
    a, b, c = np.var(step), np.mean((even - even.mean()) * (step - step.mean())), np.var(even)
    if c >= variance:
        return 0.0
    if not a > 0:
        return _MOST_LAMPS
    return float(min((np.sqrt(b * b + a * (variance - c)) - b) / a, _MOST_LAMPS))


def _shaded(lights: np.ndarray, normal: np.ndarray, exponent: float) -> np.ndarray:
    """Return D and S `(L, N, 2)` of normals `(N, 3)` under lights `(L, 64, 128)`, from afar."""
    solid = environment.solid_angles(*lights.shape[1:])
    rows, columns = _SHAPE
    energy = (lights * solid).reshape(len(lights), rows, 2, columns, 2).sum(axis=(2, 4))
    energy = energy.reshape(len(lights), -1)
    direction = environment.directions(*_SHAPE).reshape(-1, 3)
    towards = normal @ direction.T
    half = direction + np.array([0.0, 0.0, 1.0])
    half /= np.maximum(np.linalg.norm(half, axis=-1, keepdims=True), 1e-6)
    lobe = np.maximum(normal @ half.T, 0.0) ** exponent * (towards > 0)
    diffuse = energy @ np.maximum(towards, 0).T / np.pi
    return np.stack([diffuse, float(shading.normaliser(exponent)) * (energy @ lobe.T)], axis=-1)
