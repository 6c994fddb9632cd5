"""The material formats of other tools: Wavefront MTL, glTF 2.0 and a Mitsuba scene.

Neither glTF nor Mitsuba has the lobe of Eq. 3, which has no cosine factor. Both get a microfacet
lobe over a diffuse base that receives the rest of the light, so that together they come near
m_d · D + m_s · S. Three things were chosen for the least ꟻLIP between spheres of both
(docs/results.md):

- The roughness: Beckmann's distribution in Mitsuba, GGX in glTF (`lime_keras.optics.microfacets`).
- The lobe's reflectance, 0.76 m_s. S falls with o·n, a microfacet lobe does not.
- For s below about 5, a part of m_s that goes to the base instead: the lobe is then so wide that it
  looks diffuse, and a rough microfacet surface shadows itself.

An estimate may reflect more light than arrives, which no material of glTF or Mitsuba does. Their
albedos are then smaller by one factor, `albedo_scale`. Hue and gloss stay. Under a light that is
brighter by the same factor the whole look stays, for only the product of light and albedo is seen.

All functions but `remarks` raise ValueError if the material lacks an albedo or the exponent.
"""

import base64
import json
import math
from dataclasses import replace
from typing import Any

import numpy as np

from lime_keras.material import Material
from lime_keras.optics import microfacets, studio_light
from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.optics.shading import normaliser
from lime_keras.version import __version__

_SPHERE_ROWS, _SPHERE_COLUMNS = 32, 64
SPHERE_DISTANCE = 3.5  # distance of Mitsuba's camera from the middle of the unit sphere
_FAR = 1000.0  # distance of Mitsuba's lights, in radii of the sphere
_BEHIND = 100.0  # distance of the fill, over that of the lights before it
_FLOAT, _UNSIGNED_SHORT = 5126, 5123  # numbers of glTF for component types
_VERTICES, _INDICES = 34962, 34963  # and for buffer targets
_MOST_BRIGHT = 25.0
"""Factor that makes 1 of glTF's F0 = 0.04 of a dielectric, so `specularFactor` alone sets F0."""
_LOBE_SHARE = 0.76  # reflectance of the microfacet lobe, as a share of m_s, for a narrow lobe
_DIFFUSE_BELOW = 1.5  # exponent at which half of m_s goes to the diffuse base
_UNSEEN = 0.99  # least factor of the albedos that is not worth a warning


def albedo_scale(material: Material) -> float:
    """Return the factor in (0, 1] by which glTF and Mitsuba get smaller albedos than the estimate.

    The least reduction is taken that leaves no more light reflected than arrives.

    Example:
        >>> albedo_scale(Material(np.full(3, 0.5), 0.04, 100.0))
        1.0
        >>> round(albedo_scale(Material(np.full(3, 0.9), 0.9, 100.0)), 2)
        0.63
    """
    diffuse, lobe = _layers(material)
    return 1 / max(float(np.max(diffuse)) + lobe, 1.0)


def remarks(material: Material) -> list[str]:
    """Return the warning of a whole material whose albedos are written 1 % smaller or more."""
    scale = 1.0 if material.whole() is None else albedo_scale(material)
    if scale > _UNSEEN:
        return []
    return [
        f"the material would reflect {1 / scale:.2f} times the light that it gets, so its albedos "
        f"are {scale:.2f} times the estimate in the glTF and Mitsuba files, of the same hue and "
        f"gloss; for the photo's brightness make the light there {1 / scale:.2f} times as bright"
    ]


def lobe_reflectance(material: Material) -> float:
    """Return the reflectance of the microfacet lobe, in [0, 0.76], the same at every angle."""
    return albedo_scale(material) * _layers(material)[1]


def base_colour(material: Material) -> np.ndarray:
    """Return the colour of the diffuse base below the lobe, linear RGB `(3,)` in [0, 1]."""
    diffuse, lobe = _layers(material)
    scale = albedo_scale(material)
    return np.clip(scale * diffuse / (1 - scale * lobe), 0, 1)


def wavefront(material: Material, name: str) -> str:
    """Return the text of an MTL file: Kd = m_d and Ks = m_s, both linear, and Ns = min(s, 1000).

    The format's formula adds both parts and clips nothing, so the albedos are those of the
    estimate. Ks is the lobe's reflectance. Viewers that normalise the lobe, such as three.js, take
    it so. The format's own formula does not: there Ks is the height of the highlight, which a
    comment gives.
    """
    whole = _whole(material)
    exponent = min(whole.exponent, 1000.0)
    kd = " ".join(f"{value:.6f}" for value in whole.diffuse_albedo)
    ks = " ".join([f"{whole.specular_albedo:.6f}"] * 3)
    word = "_".join(name.split()) or "material"  # a name in MTL ends at a space
    peak = whole.specular_albedo * math.pi * float(normaliser(exponent))
    return (
        f"# lime_keras {__version__}: Blinn-Phong, linear RGB; Ks is a reflectance, not a peak\n"
        f"# For a viewer that does not normalise the lobe, Ks is {peak:.6g}\n"
        f"newmtl {word}\n"
        f"Ka 0 0 0\nKd {kd}\nKs {ks}\nNs {exponent:.4f}\n"
        "illum 2\n"
    )


def gltf(material: Material, name: str) -> str:
    """Return a glTF 2.0 file as JSON text with all its data: the material on a unit sphere.

    The roughness written is √α, because glTF squares it. KHR_materials_specular gives the lobe the
    same reflectance f at every angle: F0 = min(0.04 · 25, 1) · f, F90 = f. The material's `extras`
    hold `albedo_scale`.
    """
    # The sphere, whose positions are its normals.
    positions, triangles = _sphere()
    vertices, indices = positions.astype("<f4").tobytes(), triangles.astype("<u2").tobytes()
    buffer = base64.b64encode(vertices + indices).decode()
    views = [
        {"buffer": 0, "byteLength": len(vertices), "target": _VERTICES, "byteOffset": 0},
        {"buffer": 0, "byteLength": len(indices), "target": _INDICES, "byteOffset": len(vertices)},
    ]
    accessors = [
        {
            "bufferView": 0,
            "componentType": _FLOAT,
            "count": len(positions),
            "type": "VEC3",
            "min": positions.min(0).tolist(),
            "max": positions.max(0).tolist(),
        },
        {
            "bufferView": 1,
            "componentType": _UNSIGNED_SHORT,
            "count": triangles.size,
            "type": "SCALAR",
        },
    ]
    triangle_list = {"attributes": {"POSITION": 0, "NORMAL": 0}, "indices": 1, "material": 0}

    # The material.
    surface = {
        "name": name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*_numbers(base_colour(material)), 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": _number(math.sqrt(microfacets.ggx_alpha(_whole(material).exponent))),
        },
        "extensions": {
            "KHR_materials_specular": {
                "specularFactor": _number(lobe_reflectance(material)),
                "specularColorFactor": [_MOST_BRIGHT] * 3,
            }
        },
        "extras": {"albedo_scale": _number(albedo_scale(material))},
    }

    # The file.
    whole = {
        "asset": {"version": "2.0", "generator": f"lime_keras {__version__}"},
        "extensionsUsed": ["KHR_materials_specular"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [{"name": name, "primitives": [triangle_list]}],
        "materials": [surface],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [
            {
                "byteLength": len(vertices) + len(indices),
                "uri": f"data:application/octet-stream;base64,{buffer}",
            }
        ],
    }
    return json.dumps(whole, indent=1) + "\n"


def mitsuba_scene(material: Material) -> dict[str, Any]:
    """Return a scene for `mitsuba.load_dict`: the material on a sphere in a studio.

    The light is that of `studio_light`, brighter by 1 / `albedo_scale`, so that the picture is as
    bright as the estimate. The material itself is `sphere.bsdf`, to be copied into other scenes.
    All values are plain numbers and lists, so JSON can hold the scene.
    """
    lights = {
        f"light_{index}": _light(*disc, index, 1 / albedo_scale(material))
        for index, disc in enumerate(studio_light.LIGHTS)
    }
    return {
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 2, "bsdf_samples": 2},
        "sensor": {
            "type": "perspective",
            "fov": 40.0,
            "film": {"type": "hdrfilm", "width": 256, "height": 256},
            "sampler": {"type": "multijitter", "sample_count": 256},
        },
        **lights,
        "sphere": {
            "type": "sphere",
            "center": [0.0, 0.0, SPHERE_DISTANCE],
            "radius": 1.0,
            "bsdf": {
                "type": "blendbsdf",
                "weight": _number(lobe_reflectance(material)),
                "base": {
                    "type": "diffuse",
                    "reflectance": {"type": "rgb", "value": _numbers(base_colour(material))},
                },
                "lobe": {
                    "type": "roughconductor",
                    "material": "none",
                    "distribution": "beckmann",
                    "alpha": _number(microfacets.beckmann_alpha(_whole(material).exponent)),
                },
            },
        },
    }


def _light(
    direction: tuple[float, float, float], radius: float, strength: float, index: int, factor: float
) -> dict[str, Any]:
    """Return a far sphere that looks as a disc of light of this angular radius in degrees does."""
    # The fill comes first. It bulges towards the middle, so it lies far behind the others.
    far = _FAR * (1 if index else _BEHIND)
    # Mitsuba's camera looks along z with x to the left; camera space has both the other way round.
    x, y, z = far * np.array(direction) / np.linalg.norm(direction)
    return {
        "type": "sphere",
        "center": _numbers(np.array([-x, y, SPHERE_DISTANCE - z])),
        "radius": _number(far * math.sin(math.radians(radius))),
        "emitter": {
            "type": "area",
            "radiance": {"type": "rgb", "value": [_number(strength * factor)] * 3},
        },
    }


def _layers(material: Material) -> tuple[np.ndarray, float]:
    """Return what base `(3,)` and lobe reflect, linear, before `albedo_scale`."""
    whole = _whole(material)
    wide = 1 / (1 + (whole.exponent / _DIFFUSE_BELOW) ** 2)
    specular = whole.specular_albedo
    return whole.diffuse_albedo + wide * specular, (1 - wide) * _LOBE_SHARE * specular


def _whole(material: Material) -> BlinnPhong:
    """Return the complete material, with albedos in double precision."""
    whole = material.whole()
    if whole is None:
        raise ValueError("this estimate lacks a number: estimate `albedo` and `exponent`")
    return replace(whole, diffuse_albedo=np.asarray(whole.diffuse_albedo, np.float64))


def _number(value: float) -> float:
    return float(f"{value:.6g}")


def _numbers(values: np.ndarray) -> list[float]:
    return [_number(value) for value in values]


def _sphere() -> tuple[np.ndarray, np.ndarray]:
    """Return the unit sphere's vertices `(V, 3)` and triangles `(T, 3)`, outside anticlockwise."""
    theta = np.linspace(0, math.pi, _SPHERE_ROWS + 1)[:, None]
    phi = np.linspace(0, 2 * math.pi, _SPHERE_COLUMNS + 1)[None, :]
    parts = np.broadcast_arrays(
        np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)
    )
    vertices = np.stack(parts, axis=-1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(_SPHERE_ROWS)[:, None] * (_SPHERE_COLUMNS + 1)) + np.arange(_SPHERE_COLUMNS)
    below = corner + _SPHERE_COLUMNS + 1
    upper = np.stack([corner, below, corner + 1], axis=-1)[1:].reshape(-1, 3)
    lower = np.stack([corner + 1, below, below + 1], axis=-1)[:-1].reshape(-1, 3)
    return vertices, np.concatenate([upper, lower])
