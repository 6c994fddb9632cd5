"""Direct sums for D and S (Eqs. 2 and 3) over the texels of a map, and the mirror direction of M.

Letters as in the paper: `n` surface normal, `o` direction to the viewer, both unit, `(N, 3)`, in
the map's frame; `i` direction to the light; `h` half vector; `s` exponent. Shading is normalised to
the white furnace: for E ≡ 1, D = 1, M = 1 and, at n = o, S = 1. As printed they are
π D and S / c(s), with c(s) of `normaliser`.

The functions use NumPy, in the precision of the given arrays. They are the reference in the tests
of the fast renderer, and replace it where it cannot run. `normaliser` takes Keras tensors, too.
"""

import math
from typing import Any

import numpy as np

from lime_keras.optics import environment
from lime_keras.optics.namespace import namespace

_CHUNK = 2**17  # number of pixel-light pairs computed at once: few enough for the processor's cache

ASSUMED_FOCAL = 1.2
"""Assumed focal length over the photo's longer side: 43 mm on 36 mm film.

This lies between the lens of a telephone and a long lens.
"""


def view_directions(camera: np.ndarray, height: int, width: int) -> np.ndarray:
    """Return the unit directions o to the viewer, `(height, width, 3)`, of the pixel centres.

    They are in camera space (x right, y up, z towards the camera). The camera is fx, fy, cx and cy,
    in pixels as the image's height and width.
    """
    fx, fy, cx, cy = (float(value) for value in camera)
    x = (np.arange(width) + 0.5 - cx) / fx
    y = -(np.arange(height) + 0.5 - cy) / fy
    towards_scene = np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), axis=-1)
    return -towards_scene / np.linalg.norm(towards_scene, axis=-1, keepdims=True)


def assumed_camera(height: int, width: int) -> np.ndarray:
    """Return fx, fy, cx, cy in pixels, `(4,)`, for a photo whose camera is not known.

    The photo is assumed to be taken with a normal lens (`ASSUMED_FOCAL`) and not cropped.
    """
    focal = ASSUMED_FOCAL * max(height, width)
    return np.array([focal, focal, width / 2, height / 2])


def reflect(normal: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Return the mirror direction 2(o·n)n − o, `(N, 3)`, of unit vectors n and o, `(N, 3)`.

    M(n, o), the light from there, is `environment.lookup` of the map in this direction.

    Example:
        >>> up, view = np.array([[0.0, 0.0, 1.0]]), np.array([[0.6, 0.0, 0.8]])
        >>> reflect(up, view).tolist()
        [[-0.6, 0.0, 0.8]]
    """
    return 2 * np.einsum("...i,...i->...", normal, view)[..., None] * normal - view


def diffuse(normal: np.ndarray, light: np.ndarray, energy: np.ndarray) -> np.ndarray:
    """Return D(n) = 1/π ∫_{i·n>0} (i·n) E(i) di as a sum over lights, linear radiance `(N,)`.

    Args:
        normal: n, unit, `(N, 3)`.
        light: unit directions of the lights `(T, 3)`; `texels` returns the lights of a map.
        energy: linear radiance × solid angle in steradians of each light, `(T,)`, at least 0.

    Example:
        In a white furnace D is 1, whatever the normal:

        >>> lights = texels(np.ones((64, 128)))
        >>> diffuse(np.array([[0.0, 0.6, 0.8]]), *lights).round(3).tolist()
        [1.0]
    """
    out = np.empty(len(normal), normal.dtype)
    for rows in _chunks(len(normal), len(light)):
        out[rows] = np.maximum(normal[rows] @ light.T, 0) @ energy
    return out / np.asarray(math.pi, out.dtype)


def normaliser(exponent: Any) -> Any:
    """Return c(s) = (s + 2) / (8π (1 − 2^(−(s+2)/2))), which makes S = 1 in a furnace at n = o.

    c(0) = 1/(2π); c(s) → (s + 2)/(8π) as s grows.

    Args:
        exponent: s, at least 0, of any shape; a NumPy array or a Keras tensor.

    Returns:
        c(s), of the shape of s, at least 1/(2π).

    Raises:
        ValueError: if an exponent of an array is negative or NaN; tensors are not looked at.

    Example:
        >>> round(float(2 * math.pi * normaliser(0.0)), 6)
        1.0
    """
    xp = namespace(exponent)
    if xp is np and not np.all(np.asarray(exponent) >= 0):
        raise ValueError(f"exponents are at least 0, got {np.min(exponent)}: check the material")
    # expm1 keeps the digits of 1 − 2^(−a); here a is at least 1, so the result is never zero.
    spread = -xp.expm1(-(exponent + 2.0) * (0.5 * math.log(2.0)))
    return (exponent + 2.0) / (8.0 * math.pi * spread)


def lobe_factor(exponent: Any, lobe: str) -> Any:
    """Return the factor from the furnace-normalised S to the S of a corpus; m_s is divided by it.

    With the printed lobe S = 1/π ∫_{i·n>0} (h·n)^s E(i) di: Eq. 3 without c(s), divided by π as D
    is, so that m_s and m_d keep the ratio that Eqs. 2 and 3 print. The light's scale is free, so
    this is the printed pair under a light 1/π as bright.

    Args:
        exponent: s, at least 0, of any shape; a NumPy array or a Keras tensor.
        lobe: one of `lime_keras.data.corpus.LOBES`.

    Returns:
        1 for `furnace`; 1 / (π c(s)) for `printed`: 2 at s = 0, 0.008 at s = 1000.

    Example:
        >>> float(lobe_factor(0.0, "printed")), lobe_factor(0.0, "furnace")
        (2.0, 1.0)
    """
    return 1.0 if lobe == "furnace" else 1.0 / (math.pi * normaliser(exponent))


def specular(
    normal: np.ndarray, view: np.ndarray, exponent: float, light: np.ndarray, energy: np.ndarray
) -> np.ndarray:
    """Return S(n, o, s) = c(s) ∫_{i·n>0} (h·n)^s E(i) di as a sum over lights, `(N,)`.

    S is linear radiance. Exactly opposite directions i = −o have no half vector; they contribute
    nothing.

    Args:
        normal: n, unit, `(N, 3)`.
        view: o, unit, `(N, 3)`.
        exponent: s, at least 0.
        light: unit directions of the lights `(T, 3)`; `texels` returns the lights of a map.
        energy: linear radiance × solid angle in steradians of each light, `(T,)`, at least 0.

    Example:
        In a white furnace seen along the normal S is 1, whatever the exponent:

        >>> lights, normal = texels(np.ones((256, 512))), np.array([[0.0, 0.6, 0.8]])
        >>> [specular(normal, normal, s, *lights).round(2).tolist() for s in (1.0, 50.0, 500.0)]
        [[1.0], [1.0], [1.0]]
    """
    total = sum_lobes(lobe_terms(normal, view), exponent, light, energy)
    return total * np.asarray(normaliser(float(exponent)), total.dtype)


def lobe_terms(normal: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Return what `sum_lobes` needs of unit normals and view directions.

    Both are `(N, 3)`; the result is `(2, N, 4)`.

    h·n = (i·n + o·n) / |i + o|, and |i + o|² = 2 + 2 i·o. With a fourth coordinate of the light,
    equal to 1, i·n + o·n and |i + o|² are its products with these terms.
    """
    cosine = np.einsum("ij,ij->i", normal, view)[:, None]
    across = np.concatenate([normal, cosine], axis=1)
    return np.stack([across, 2 * np.concatenate([view, np.ones_like(cosine)], axis=1)])


def sum_lobes(
    terms: np.ndarray, exponent: float, light: np.ndarray, energy: np.ndarray
) -> np.ndarray:
    """Return S(n, o, s) / c(s), `(N,)`, of surfaces with the terms `(2, N, 4)` by `lobe_terms`.

    The other arguments are those of `specular`.
    """
    across, along = terms
    out = np.empty(len(across), across.dtype)
    towards = np.concatenate([light, np.ones((len(light), 1), light.dtype)], axis=1).T
    behind = np.maximum(across[:, 3:], 0)
    # Below it float16 is 0, by which opposite directions would be divided.
    least = max(1e-12, float(np.finfo(across.dtype).tiny))
    for rows in _chunks(len(across), len(light)):
        lobe = across[rows] @ towards
        lit = lobe > behind[rows]  # i·n > 0 and h·n > 0
        # The square root is worth its time: (h·n)² would lose digits.
        length = along[rows] @ towards
        # The square is at most 4; `clip` between two numbers takes a third of `maximum`'s time.
        np.sqrt(np.clip(length, least, 4, out=length), out=length)
        lobe /= length
        np.clip(lobe, np.finfo(lobe.dtype).tiny, 1, out=lobe)
        np.log(lobe, out=lobe)
        lobe *= exponent
        np.exp(lobe, out=lobe)
        if not lit.all():
            lobe *= lit
        out[rows] = lobe @ energy
    return out


def texels(radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit directions `(T, 3)` and energies `(T,)` of a map's texels that are not black.

    The energy of a texel is its radiance × its solid angle in steradians.

    Args:
        radiance: linear radiance `(H, W)`, at least 0.

    Raises:
        ValueError: if a texel is NaN, infinite or negative.
    """
    environment.check(radiance)
    energy = (radiance * environment.solid_angles(*radiance.shape)).reshape(-1)
    lit = energy > 0
    light = environment.directions(*radiance.shape).reshape(-1, 3)
    return light[lit].astype(radiance.dtype), energy[lit].astype(radiance.dtype)


def _chunks(pixels: int, texels: int) -> list[slice]:
    """Return slices of the pixels, each of at most `_CHUNK` pairs of a pixel and a light."""
    step = max(1, _CHUNK // max(texels, 1))
    return [slice(start, start + step) for start in range(0, pixels, step)]
