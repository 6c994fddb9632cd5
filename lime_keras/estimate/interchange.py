"""The material formats of other tools: Wavefront MTL, glTF 2.0 and a Mitsuba scene.

Neither glTF nor Mitsuba has this Blinn–Phong lobe. Both get the nearest microfacet lobe, of
roughness α = √(2 / (s + 2)): the Phong distribution of exponent s and Beckmann's distribution of
this α have nearly the same shape (Walter et al. 2007, section 5.2). Both place a lobe of constant
reflectance m_s on a diffuse base, which receives the rest of the light. The base's colour is
therefore m_d / (1 − m_s), so that the result is m_d · D + m_s · S. A base colour above 1 is
clipped, and the written material is then darker than the estimate. This happens if m_d + m_s > 1,
which would reflect more light than arrives.
"""

import base64
import json
import math
from typing import Any

import numpy as np

from lime_keras.material import Material
from lime_keras.version import __version__

_SPHERE_ROWS, _SPHERE_COLUMNS = 32, 64
_FLOAT, _UNSIGNED_SHORT = 5126, 5123
_VERTICES, _INDICES = 34962, 34963
"""Numbers of glTF for component types and buffer targets."""
_MOST_BRIGHT = 25.0
"""Factor that makes 1 of glTF's F0 = 0.04 of a dielectric, so `specularFactor` alone sets F0."""


def roughness(exponent: float) -> float:
    """Return the microfacet roughness α, in (0, 1], of a Blinn–Phong exponent s, at least 0."""
    return math.sqrt(2 / (exponent + 2))


def base_colour(material: Material) -> np.ndarray:
    """Return the colour of the diffuse base below the lobe, linear RGB `(3,)` in [0, 1].

    Raises:
        ValueError: if the material has no albedos.
    """
    diffuse, specular = _albedos(material)
    return np.clip(diffuse / max(1 - specular, 1e-6), 0, 1)


def wavefront(material: Material, name: str) -> str:
    """Return the text of an MTL file: Kd = m_d and Ks = m_s, both linear, and Ns = min(s, 1000).

    The lobe of MTL is not normalised. Ks is the reflectance here. A viewer that takes Ks for the
    height of a highlight shows shiny materials too dull, by the factor π c(s).

    Raises:
        ValueError: if the material has no albedos or no exponent.
    """
    diffuse, specular = _albedos(material)
    kd = " ".join(f"{value:.6f}" for value in diffuse)
    ks = " ".join([f"{specular:.6f}"] * 3)
    return (
        f"# lime_keras {__version__}: Blinn-Phong, linear RGB; Ks is a reflectance, not a peak\n"
        f"newmtl {_word(name)}\n"
        f"Ka 0 0 0\nKd {kd}\nKs {ks}\nNs {min(_exponent(material), 1000.0):.4f}\n"
        "illum 2\n"
    )


def gltf(material: Material, name: str) -> str:
    """Return a glTF 2.0 file as JSON text with all its data: the material on a unit sphere.

    The roughness written is √α, because glTF squares it. KHR_materials_specular gives the lobe the
    same reflectance m_s at every angle: F0 = min(0.04 · 25, 1) · m_s, F90 = m_s.

    Raises:
        ValueError: if the material has no albedos or no exponent.
    """
    _, specular = _albedos(material)
    positions, triangles = _sphere()
    vertices, indices = positions.astype("<f4").tobytes(), triangles.astype("<u2").tobytes()
    buffer = base64.b64encode(vertices + indices).decode()
    whole = {
        "asset": {"version": "2.0", "generator": f"lime_keras {__version__}"},
        "extensionsUsed": ["KHR_materials_specular"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [
            {
                "name": name,
                "primitives": [
                    # On a unit sphere, positions are normals.
                    {"attributes": {"POSITION": 0, "NORMAL": 0}, "indices": 1, "material": 0}
                ],
            }
        ],
        "materials": [
            {
                "name": name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*_numbers(base_colour(material)), 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": _number(math.sqrt(roughness(_exponent(material)))),
                },
                "extensions": {
                    "KHR_materials_specular": {
                        "specularFactor": _number(specular),
                        "specularColorFactor": [_MOST_BRIGHT] * 3,
                    }
                },
            }
        ],
        "accessors": [
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
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(vertices), "target": _VERTICES, "byteOffset": 0},
            {
                "buffer": 0,
                "byteLength": len(indices),
                "target": _INDICES,
                "byteOffset": len(vertices),
            },
        ],
        "buffers": [
            {
                "byteLength": len(vertices) + len(indices),
                "uri": f"data:application/octet-stream;base64,{buffer}",
            }
        ],
    }
    return json.dumps(whole, indent=1) + "\n"


def mitsuba_scene(material: Material) -> dict[str, Any]:
    """Return a scene for `mitsuba.load_dict`: the material on a sphere under constant light.

    The material itself is `sphere.bsdf`, to be copied into other scenes. All values are plain
    numbers and lists, so JSON can hold the scene.

    Raises:
        ValueError: if the material has no albedos or no exponent.
    """
    _, specular = _albedos(material)
    return {
        "type": "scene",
        "integrator": {"type": "direct"},
        "sensor": {
            "type": "perspective",
            "fov": 40.0,
            "film": {"type": "hdrfilm", "width": 256, "height": 256},
        },
        "emitter": {"type": "constant", "radiance": {"type": "rgb", "value": [1.0, 1.0, 1.0]}},
        "sphere": {
            "type": "sphere",
            "center": [0.0, 0.0, 3.5],
            "radius": 1.0,
            "bsdf": {
                "type": "blendbsdf",
                "weight": _number(specular),
                "base": {
                    "type": "diffuse",
                    "reflectance": {"type": "rgb", "value": _numbers(base_colour(material))},
                },
                "lobe": {
                    "type": "roughconductor",
                    "material": "none",
                    "distribution": "beckmann",
                    "alpha": _number(roughness(_exponent(material))),
                },
            },
        },
    }


def _albedos(material: Material) -> tuple[np.ndarray, float]:
    if material.diffuse_albedo is None or material.specular_albedo is None:
        raise ValueError("this estimate holds no albedos: estimate `albedo` and `exponent` as well")
    return np.asarray(material.diffuse_albedo, np.float64), material.specular_albedo


def _exponent(material: Material) -> float:
    if material.exponent is None:
        raise ValueError("this estimate holds no exponent: estimate `albedo` and `exponent`")
    return material.exponent


def _word(name: str) -> str:
    """Return a name without spaces, because a name in MTL ends at a space."""
    return "_".join(name.split()) or "material"


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
