"""Eqs. 1–3 by direct sums over an environment map's texels: D, S and M.

Letters as in the paper: `n` surface normal, `o` direction to the viewer, both unit, `(N, 3)`, in
the map's frame; `i` direction to the light; `h` half vector; `s` exponent. Shading is normalised to
the white furnace: for E ≡ 1, D = 1, M = 1 and, at n = o, S = 1. `literal_scale` undoes it.

NumPy, in the precision of the arrays given: the reference that the fast renderer is tested against,
and what runs where no fast renderer can. `normaliser` takes tensors of Keras, too.
"""

import math
from typing import Any

import numpy as np

from lime_keras.arrays import namespace
from lime_keras.optics import environment

_CHUNK = 2**17
"""Pixel-light pairs computed at once: few enough that all stays in the processor's cache."""

ASSUMED_FOCAL = 1.2
"""Focal length over the photo's longer side: 43 mm on 36 mm film, between a telephone and a long
lens."""


def view_directions(camera: np.ndarray, height: int, width: int) -> np.ndarray:
    """Directions o to the viewer, `(height, width, 3)`, one for each pixel centre.

    Args:
        camera: fx, fy, cx, cy in pixels.
        height: of the image.
        width: of the image.
    """
    fx, fy, cx, cy = (float(value) for value in camera)
    x = (np.arange(width) + 0.5 - cx) / fx
    y = -(np.arange(height) + 0.5 - cy) / fy
    towards_scene = np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), axis=-1)
    return -towards_scene / np.linalg.norm(towards_scene, axis=-1, keepdims=True)


def assumed_camera(height: int, width: int) -> np.ndarray:
    """fx, fy, cx, cy in pixels of a photo whose camera is not known: a normal lens, not cropped."""
    focal = ASSUMED_FOCAL * max(height, width)
    return np.array([focal, focal, width / 2, height / 2])


def reflect(normal: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Mirror direction 2(o·n)n − o, `(N, 3)`."""
    return 2 * np.sum(normal * view, axis=-1, keepdims=True) * normal - view


def mirror(normal: np.ndarray, view: np.ndarray, radiance: np.ndarray) -> np.ndarray:
    """M(n, o) = E(2(o·n)n − o), `(N,)`, bilinear in the map `(H, W)`.

    Raises:
        ValueError: if a texel is NaN, infinite or negative.
    """
    environment.check(radiance)
    return environment.lookup(radiance, reflect(normal, view))


def diffuse(normal: np.ndarray, light: np.ndarray, energy: np.ndarray) -> np.ndarray:
    """D(n) = 1/π ∫_{i·n>0} (i·n) E(i) di as a sum over lights, `(N,)`.

    Args:
        normal: n, `(N, 3)`.
        light: unit directions `(T, 3)`; `texels` gives those of a map.
        energy: radiance times solid angle of each, `(T,)`.
    """
    out = np.empty(len(normal), normal.dtype)
    for rows in _chunks(len(normal), len(light)):
        out[rows] = np.maximum(normal[rows] @ light.T, 0) @ energy
    return out / np.asarray(math.pi, out.dtype)


def normaliser(exponent: Any) -> Any:
    """Return c(s) = (s + 2) / (8π (1 − 2^(−(s+2)/2))), which makes S = 1 in a furnace at n = o.

    c(0) = 1/(2π); c(s) → (s + 2)/(8π) as s grows.

    Args:
        exponent: s, at least 0, of any shape; NumPy or a Keras tensor.
    """
    xp = namespace(exponent)
    # 1 − 2^(−a) by expm1 keeps its digits; here a is at least 1, so it never cancels to zero.
    spread = -xp.expm1(-(exponent + 2.0) * (0.5 * math.log(2.0)))
    return (exponent + 2.0) / (8.0 * math.pi * spread)


def specular(
    normal: np.ndarray, view: np.ndarray, exponent: float, light: np.ndarray, energy: np.ndarray
) -> np.ndarray:
    """S(n, o, s) = c(s) ∫_{i·n>0} (h·n)^s E(i) di as a sum over lights, `(N,)`.

    Exactly opposite directions i = −o have no half vector; they contribute nothing.

    Args:
        normal: n, `(N, 3)`.
        view: o, `(N, 3)`.
        exponent: s, at least 0.
        light: unit directions `(T, 3)`; `texels` gives those of a map.
        energy: radiance times solid angle of each, `(T,)`.
    """
    out = np.empty(len(normal), normal.dtype)
    cosine = np.einsum("ij,ij->i", normal, view)[:, None]
    # h·n = (i·n + o·n) / |i + o|, and |i + o|² = 2 + 2 i·o, both by a fourth coordinate of the
    # light that is 1. The root costs less than the digits that a square of h·n would lose.
    towards = np.concatenate([light, np.ones((len(light), 1), light.dtype)], axis=1).T
    across = np.concatenate([normal, cosine], axis=1)
    along = 2 * np.concatenate([view, np.ones_like(cosine)], axis=1)
    behind = np.maximum(cosine, 0)
    for rows in _chunks(len(normal), len(light)):
        lobe = across[rows] @ towards
        lit = lobe > behind[rows]  # i·n > 0 and h·n > 0
        length = along[rows] @ towards
        np.sqrt(np.maximum(length, 1e-12, out=length), out=length)
        lobe /= length
        np.clip(lobe, np.finfo(lobe.dtype).tiny, 1, out=lobe)
        np.log(lobe, out=lobe)
        lobe *= exponent
        np.exp(lobe, out=lobe)
        lobe *= lit
        out[rows] = lobe @ energy
    return out * np.asarray(normaliser(float(exponent)), out.dtype)


def texels(radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A map `(H, W)` as lights: directions `(T, 3)` and energies `(T,)` of its lit texels.

    Raises:
        ValueError: if a texel is NaN, infinite or negative.
    """
    environment.check(radiance)
    energy = (radiance * environment.solid_angles(*radiance.shape)).reshape(-1)
    lit = energy > 0
    light = environment.directions(*radiance.shape).reshape(-1, 3)
    return light[lit].astype(radiance.dtype), energy[lit].astype(radiance.dtype)


def literal_scale(exponent: float) -> tuple[float, float]:
    """Factors that turn furnace-normalised D and S into the paper's printed Eqs. 2 and 3."""
    return math.pi, 1.0 / normaliser(float(exponent))


def _chunks(pixels: int, texels: int) -> list[slice]:
    """Slices of the pixels whose products with all lights fit the chunk."""
    step = max(1, _CHUNK // max(texels, 1))
    return [slice(start, start + step) for start in range(0, pixels, step)]
