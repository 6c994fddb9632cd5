"""The light of a scene, from the mirror image and the diffuse shading of an object (section 7).

At a pixel with unit normal n, seen from o, the mirror image M is the light from 2(o·n)n − o, and
the diffuse shading D is the cosine-weighted light of n's hemisphere. `observe` gathers M and D of
an image into maps in camera space, the evidence. `estimate` computes the light from the evidence.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from lime_keras.material import Material
from lime_keras.optics import compositing, environment, shading
from lime_keras.optics.environment import STORED_SHAPE

_NORMALS_SHAPE = (32, 64)
"""Rows and columns of the map of D. D varies slowly: a step of 5.6° changes it by 0.1 %."""
_SCALES = (8.0, 4.0, 2.0, 1.0, 0.0)
"""Blurs of the mirror image in texels; a coarser scale fills what a finer scale has not seen."""
_TRUST = 0.05
"""Number of pixels per texel at which a scale counts as much as the next coarser scale."""
_LEAST_COSINE = 0.02  # smallest o·n of a pixel that counts
_COSINE_LOBE = np.array([1.0, *[2 / 3] * 3, *[1 / 4] * 5])
"""Factor of each spherical harmonic from E to D: the clamped cosine's factor over π."""
_RIDGE = 3e-3
"""Ridge penalty. A basis function's mean square over all normals is 0.08, 0.035, 0.005 by order."""
_LENGTHS = (0.5, 1.5)  # shortest and longest length that a normal may have


@dataclass(frozen=True)
class Evidence:
    """The evidence of the light in an image, in camera space.

    Attributes:
        mirror: `(64, 128)` sums of weight × M, by mirrored direction.
        mirror_weight: `(64, 128)` sums of these weights; a fully covered pixel that faces the
            viewer has weight 1.
        diffuse: `(32, 64)` sums of weight × D, by direction of the normal.
        diffuse_weight: `(32, 64)` sums of these weights; a fully covered pixel has weight 1.
    """

    mirror: np.ndarray
    mirror_weight: np.ndarray
    diffuse: np.ndarray
    diffuse_weight: np.ndarray


def observe(
    normal: np.ndarray,
    view: np.ndarray,
    mirror: np.ndarray,
    diffuse_shading: np.ndarray,
    mask: np.ndarray,
) -> Evidence:
    """Return the evidence of the light in an image.

    The weight of a pixel's M is coverage × o·n, because one pixel near the silhouette mirrors a
    wide angle. The weight of its D is the coverage. A pixel has weight 0 if its normal is zero, NaN
    or turned from the viewer; where M or D is NaN, only that value is left out.

    Args:
        normal: n, `(H, W, 3)` in camera space (x right, y up, z towards the camera).
        view: o, unit, `(H, W, 3)` in camera space (see `shading.view_directions`).
        mirror: M, linear radiance `(H, W, 1)`, at least 0.
        diffuse_shading: D, linear radiance `(H, W, 1)`, at least 0, normalised to the white furnace
            (see `compositing.diffuse_shading`).
        mask: coverage `(H, W, 1)` in [0, 1].

    Raises:
        ValueError: if the shapes differ, M or D is negative or infinite, the mask leaves [0, 1], or
            most normals do not have length 1 or are turned from the viewer.
    """
    _check(normal, view, mirror, diffuse_shading, mask)
    covered = mask[..., 0] > 0
    weight = mask[covered, 0].astype(np.float64)
    n, known = _unit(normal[covered].astype(np.float64))
    o = view[covered].astype(np.float64)
    cosine = np.sum(n * o, axis=-1)
    away = float(np.mean(cosine[known] <= 0)) if known.any() else 0.0
    if away > 0.5:
        raise ValueError(
            f"{away:.0%} of the normals are turned from the viewer: in camera space z points "
            "towards the camera; flip z, or rotate world-space normals"
        )
    weight *= known & (cosine > _LEAST_COSINE)
    mirrored = shading.reflect(n, o)
    return Evidence(
        *_gather(mirror[covered, 0], weight * np.maximum(cosine, 0), mirrored, STORED_SHAPE),
        *_gather(diffuse_shading[covered, 0], weight, n, _NORMALS_SHAPE),
    )


def _check(normal, view, mirror, diffuse, mask) -> None:
    """Raise ValueError if the shapes differ or values are no radiance or coverage."""
    shape = mask.shape[:2]
    arrays = {"normal": (normal, 3), "view": (view, 3), "mirror": (mirror, 1)}
    arrays |= {"diffuse_shading": (diffuse, 1), "mask": (mask, 1)}
    for name, (array, channels) in arrays.items():
        if array.shape != (*shape, channels):
            raise ValueError(
                f"{name} has shape {array.shape}, but the mask {mask.shape}: expected "
                f"{(*shape, channels)}; bring all to the size of the mask"
            )
    for name, values in (("mirror", mirror), ("diffuse_shading", diffuse)):
        if np.any((values < 0) | np.isinf(values)):
            raise ValueError(f"{name} is radiance, at least 0 and finite; NaN where not known")
    if not np.all((mask >= 0) & (mask <= 1)):
        raise ValueError("a mask's values are in [0, 1]: divide 8-bit ones by 255")


def _unit(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return normals `(N, 3)` of length 1, or 0 where unknown, and which are known, `(N,)` bool."""
    length = np.linalg.norm(normal, axis=-1)
    finite = np.isfinite(length) & (length > 0)
    known = finite & (length >= _LENGTHS[0]) & (length <= _LENGTHS[1])
    if finite.any() and np.mean(known[finite]) < 0.5:
        raise ValueError(
            f"normals have length 1, got a median of {np.median(length[finite]):.3g}: decode "
            "(n = 2 v − 1) or normalise them"
        )
    return np.where(known[:, None], normal / np.where(known, length, 1)[:, None], 0), known


def _gather(
    values: np.ndarray, weight: np.ndarray, direction: np.ndarray, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return two maps of `shape`: weighted sums of values by direction, and sums of the weights."""
    kept = (weight > 0) & np.isfinite(values)
    values, weight, direction = values[kept], weight[kept], direction[kept]
    return (
        environment.splat(values * weight, direction, *shape),
        environment.splat(weight, direction, *shape),
    )


def filled(evidence: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Return the mirrored light `(64, 128)` and the share of each direction that was not seen.

    The scales are combined from coarse to fine. At each scale, the light seen is averaged with the
    result of the coarser scale, by their weights. Before the coarsest scale the light is 0. The
    share, in [0, 1], is the weight of this initial 0 in the result.
    """
    relative = environment.solid_angles(*STORED_SHAPE) / (2 * math.pi**2 / np.prod(STORED_SHAPE))
    light, unseen = np.zeros(STORED_SHAPE), np.ones(STORED_SHAPE)
    for scale in _SCALES:
        angle = scale * math.pi / STORED_SHAPE[0]
        total, weight = (
            environment.blur(sums / relative, angle) if scale else sums / relative
            for sums in (evidence.mirror, evidence.mirror_weight)
        )
        light = (total + _TRUST * light) / (weight + _TRUST)
        unseen = _TRUST * unseen / (weight + _TRUST)
    return light, unseen


def harmonics(direction: np.ndarray) -> np.ndarray:
    """Return the nine real spherical harmonics of order 0 to 2, `(..., 9)`, in unit directions."""
    x, y, z = np.moveaxis(direction, -1, 0)
    return np.stack(
        [
            np.full_like(x, 0.5 / math.sqrt(math.pi)),
            *(math.sqrt(0.75 / math.pi) * axis for axis in (x, y, z)),
            *(math.sqrt(3.75 / math.pi) * product for product in (x * y, y * z, z * x)),
            math.sqrt(0.3125 / math.pi) * (3 * y * y - 1),
            math.sqrt(0.9375 / math.pi) * (z * z - x * x),
        ],
        axis=-1,
    )


def estimate(evidence: Evidence) -> np.ndarray:
    """Estimate the light from evidence.

    E = M̂ + u · L + C, in three steps that do not count any light twice:

    1. M̂ is the mirrored light where it was seen, texel by texel. u, from 0 to 1, is the share of
       each direction that was not seen.
    2. L is the light in spherical harmonics up to order 2 that explains D. It fills the directions
       that were not seen. Without any D, L is uniform, with the mean of the light that was seen.
    3. C, also in harmonics up to order 2, corrects the light in all directions. It explains the
       part of D that M̂ + u · L does not explain.

    The nine coefficients of L and of C solve a ridge regression on the D of all normals seen. The
    ridge draws L towards the uniform light of the mean D, and C towards 0. The more
    alike the normals are, the stronger the ridge acts. A negative sum becomes 0.

    Returns:
        Light in camera space, linear radiance `(64, 128)`, at least 0.

    Raises:
        ValueError: if there is no evidence: no pixel of the masks has a normal and M or D.
    """
    if not (evidence.mirror_weight.any() or evidence.diffuse_weight.any()):
        raise ValueError(
            "no pixel shows the light: the mask is empty, or inside it no normal, or neither M nor "
            "D, is known; pass the mask and the normals of the same photo"
        )
    mirrored, unseen = filled(evidence)
    shaded = evidence.diffuse_weight > 0
    if not shaded.any():
        solid_angle = environment.solid_angles(*STORED_SHAPE)
        even = np.sum(mirrored * solid_angle) / np.sum((1 - unseen) * solid_angle)
        return mirrored + unseen * even
    weight = evidence.diffuse_weight[shaded]
    shading_seen = evidence.diffuse[shaded] / weight
    low = explaining(shading_seen, weight, shaded)
    light = mirrored + unseen * np.maximum(low, 0)
    missing = shading_seen - _shading(light)[shaded]
    return np.maximum(light + _low_frequencies(missing, weight, shaded), 0)


def explaining(values: np.ndarray, weight: np.ndarray, shaded: np.ndarray) -> np.ndarray:
    """Return the light of order 2 that best fits D `(N,)`; it is uniform where D says little."""
    even = np.average(values, weights=weight)
    return even + _low_frequencies(values - even, weight, shaded)


def _low_frequencies(values: np.ndarray, weight: np.ndarray, shaded: np.ndarray) -> np.ndarray:
    """Return the light `(64, 128)` of order 2 that best fits D `(N,)` in directions `shaded`."""
    basis = harmonics(environment.directions(*_NORMALS_SHAPE)[shaded]) * _COSINE_LOBE
    weighted = basis * (weight / np.sum(weight))[:, None]
    coefficients = np.linalg.solve(weighted.T @ basis + _RIDGE * np.eye(9), weighted.T @ values)
    return harmonics(environment.directions(*STORED_SHAPE)) @ coefficients


def _shading(light: np.ndarray) -> np.ndarray:
    """Return D `(32, 64)` of a light `(64, 128)`, by direction of the normal."""
    rows, columns = _NORMALS_SHAPE
    energy = light * environment.solid_angles(*STORED_SHAPE)
    energy = energy.reshape(rows, 2, columns, 2).sum(axis=(1, 3)).reshape(-1)
    weights, furnace = _cosines()
    return (weights @ energy / furnace).reshape(_NORMALS_SHAPE)


@functools.cache
def _cosines() -> tuple[np.ndarray, np.ndarray]:
    """Return max(i·n, 0), `(2048, 2048)`, by normal and light, and D of a light of radiance 1."""
    directions = environment.directions(*_NORMALS_SHAPE).reshape(-1, 3).astype(np.float32)
    # In double precision, as each product would convert it anew.
    weights = np.maximum(directions @ directions.T, 0).astype(np.float64)
    return weights, weights @ environment.solid_angles(*_NORMALS_SHAPE).reshape(-1)


def from_material(
    material: Material, normal: np.ndarray, camera: np.ndarray | None = None
) -> Evidence:
    """Return the evidence of the light, in camera space, in an estimate of one photo.

    Args:
        material: estimate with the layers `mask`, `mirror` and `diffuse`, and with m_d.
        normal: normals `(H, W, 3)` in camera space at the layers' size, from `normal_map.read`, or
            roughly from `guessed_normals.normals`.
        camera: fx, fy, cx, cy in pixels; by default `shading.assumed_camera`.

    Raises:
        ValueError: if the material lacks a layer or m_d, or the arrays do not fit (see `observe`).
    """
    lacking = [name for name in ("mask", "mirror", "diffuse") if name not in material.layers]
    if lacking or material.diffuse_albedo is None:
        raise ValueError(
            f"the material lacks {', '.join(lacking) or 'its diffuse albedo'}: estimate mirror, "
            "albedo and diffuse as well"
        )
    mask = material.layers["mask"]
    if camera is None:
        camera = shading.assumed_camera(*mask.shape[:2])
    return observe(
        normal,
        shading.view_directions(camera, *mask.shape[:2]),
        np.maximum(material.layers["mirror"], 0),
        compositing.diffuse_shading(
            np.maximum(material.layers["diffuse"], 0), material.diffuse_albedo
        ),
        np.where(mask >= 0.5, mask, 0),
    )
