"""Section 7: the light of a scene, from the mirror image and the diffuse shading of an object.

Where a pixel of unit normal n is seen from o, its mirror image M is the light from 2(o·n)n − o, and
its diffuse shading D the cosine-weighted light of n's hemisphere. `observe` gathers both from one
image into maps of what was seen, in the scene's frame; those of several images add up; `estimate`
makes the light of them.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from lime_keras.material import Material
from lime_keras.optics import compositing, environment, shading
from lime_keras.optics.environment import STORED_SHAPE

_NORMALS_SHAPE = (32, 64)
"""D varies slowly: 5.6° between the directions in which it is gathered change it by 0.1 %."""
_SCALES = (8.0, 4.0, 2.0, 1.0, 0.0)
"""Blurs of the mirror image in texels: the coarser fill what the finer have not seen."""
_TRUST = 0.05
"""Pixels a texel at which what is seen counts as much as what the coarser scale says."""
_LEAST_COSINE = 0.02
_COSINE_LOBE = np.array([1.0, *[2 / 3] * 3, *[1 / 4] * 5])
"""What is left of each harmonic of E in D: the clamped cosine's factors over π."""
_RIDGE = 3e-3
"""Beside the mean square of a basis function over all normals, 0.08, 0.035 and 0.005 by order."""
_LENGTHS = (0.5, 1.5)
"""Of normals: shorter ones are background, longer ones no directions."""


@dataclass(frozen=True)
class Evidence:
    """What one or several images show of the light, in the scene's frame; `a + b` fuses two.

    Attributes:
        mirror: `(64, 128)` sums of weight times M, by the direction that is mirrored.
        mirror_weight: `(64, 128)` sums of the weights: whole pixels facing the viewer count 1.
        diffuse: `(32, 64)` sums of weight times D, by the normal's direction.
        diffuse_weight: `(32, 64)` sums of the weights: whole pixels count 1.
    """

    mirror: np.ndarray
    mirror_weight: np.ndarray
    diffuse: np.ndarray
    diffuse_weight: np.ndarray

    def __add__(self, other: "Evidence") -> "Evidence":
        return Evidence(
            self.mirror + other.mirror,
            self.mirror_weight + other.mirror_weight,
            self.diffuse + other.diffuse,
            self.diffuse_weight + other.diffuse_weight,
        )


def observe(
    normal: np.ndarray,
    view: np.ndarray,
    mirror: np.ndarray,
    diffuse_shading: np.ndarray,
    mask: np.ndarray,
    *,
    camera_to_scene: np.ndarray | None = None,
) -> Evidence:
    """Gather what one image shows of the light.

    A pixel's M counts by its coverage and by o·n: near the silhouette one pixel mirrors a wide
    angle. Normals that are zero or NaN, or turned from the viewer, and M or D that are NaN, are not
    known and count nothing.

    Args:
        normal: n, `(H, W, 3)` in camera space (x right, y up, z towards the camera).
        view: o, `(H, W, 3)` unit; `shading.view_directions` of the camera.
        mirror: M, `(H, W, 1)` linear radiance.
        diffuse_shading: D, `(H, W, 1)` linear radiance, furnace-normalised; see
            `compositing.diffuse_shading`.
        mask: `(H, W, 1)` coverage in [0, 1].
        camera_to_scene: `(3, 3)` rotation of this image's camera; by default the scene's frame is
            the camera's.

    Raises:
        ValueError: if the shapes differ, the rotation is none, a mask, M or D is negative or
            infinite, or the normals are none: most not of length 1, or turned from the viewer.
    """
    _check(normal, view, mirror, diffuse_shading, mask)
    rotation = np.eye(3) if camera_to_scene is None else np.asarray(camera_to_scene, np.float64)
    if rotation.shape != (3, 3) or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3):
        raise ValueError(f"camera_to_scene is a rotation (3, 3), got {camera_to_scene}")
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
    mirrored = shading.reflect(n, o) @ rotation.T
    return Evidence(
        *_gather(mirror[covered, 0], weight * np.maximum(cosine, 0), mirrored, STORED_SHAPE),
        *_gather(diffuse_shading[covered, 0], weight, n @ rotation.T, _NORMALS_SHAPE),
    )


def _check(normal, view, mirror, diffuse, mask) -> None:
    """Refuse arrays of other shapes, and what no radiance or coverage can be."""
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
    """Normals `(N, 3)` made unit, 0 where not known, and which are known."""
    length = np.linalg.norm(normal, axis=-1)
    given = np.isfinite(length) & (length > 0)
    known = given & (length >= _LENGTHS[0]) & (length <= _LENGTHS[1])
    if given.any() and np.mean(known[given]) < 0.5:
        raise ValueError(
            f"normals have length 1, got a median of {np.median(length[given]):.3g}: decode "
            "(n = 2 v − 1) or normalise them"
        )
    return np.where(known[:, None], normal / np.where(known, length, 1)[:, None], 0), known


def _gather(
    values: np.ndarray, weight: np.ndarray, direction: np.ndarray, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Weighted sums of values by direction, and sums of the weights."""
    kept = (weight > 0) & np.isfinite(values)
    values, weight, direction = values[kept], weight[kept], direction[kept]
    return (
        environment.splat(values * weight, direction, *shape),
        environment.splat(weight, direction, *shape),
    )


def _filled(evidence: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """The mirrored light `(64, 128)` where seen, falling to 0 beside it; the share not seen.

    From coarse to fine, what is seen at a scale is weighed against what the coarser one says; the
    coarsest says 0, and the share tells how much of that is left.
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
    """The nine real spherical harmonics of order 0 to 2 in unit directions `(..., 3)`."""
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
    """The light `(64, 128)`, linear radiance, at least 0, in the scene's frame.

    E = M̂ + u · L + C, in three steps, none of which counts what another has:

    1. M̂, the mirror image where it was seen, to the texel; u is the share of a direction that was
       not seen, from 0 to 1.
    2. L, the light of D in spherical harmonics of order 2, fills what was not seen. Where D is not
       known either, it is even and as bright as what was seen on the mean.
    3. C, of order 2 as well and everywhere, explains what D shows and M̂ + u · L does not.

    The nine coefficients solve a ridge regression on the D of all normals seen: L is drawn towards
    the even light of the mean D, C towards none, the more the fewer and the more alike the normals.
    Negative sums become 0.

    Raises:
        ValueError: if nothing was seen: no pixel of the masks has a normal and M or D.
    """
    if not (evidence.mirror_weight.any() or evidence.diffuse_weight.any()):
        raise ValueError(
            "no pixel shows the light: the mask is empty, or inside it no normal, or neither M nor "
            "D, is known; pass the mask and the normals of the same photo"
        )
    mirrored, unseen = _filled(evidence)
    shaded = evidence.diffuse_weight > 0
    if not shaded.any():
        solid_angle = environment.solid_angles(*STORED_SHAPE)
        even = np.sum(mirrored * solid_angle) / np.sum((1 - unseen) * solid_angle)
        return mirrored + unseen * even
    weight = evidence.diffuse_weight[shaded]
    shading_seen = evidence.diffuse[shaded] / weight
    even = np.average(shading_seen, weights=weight)
    low = even + _low_frequencies(shading_seen - even, weight, shaded)
    light = mirrored + unseen * np.maximum(low, 0)
    missing = shading_seen - _shading(light)[shaded]
    return np.maximum(light + _low_frequencies(missing, weight, shaded), 0)


def _low_frequencies(values: np.ndarray, weight: np.ndarray, shaded: np.ndarray) -> np.ndarray:
    """The light `(64, 128)` of order 2 with the diffuse shading `(N,)` of the normals `shaded`."""
    basis = harmonics(environment.directions(*_NORMALS_SHAPE)[shaded]) * _COSINE_LOBE
    weighted = basis * (weight / np.sum(weight))[:, None]
    coefficients = np.linalg.solve(weighted.T @ basis + _RIDGE * np.eye(9), weighted.T @ values)
    return harmonics(environment.directions(*STORED_SHAPE)) @ coefficients


def _shading(light: np.ndarray) -> np.ndarray:
    """D `(32, 64)`, by the normal's direction, of a light `(64, 128)`."""
    rows, columns = _NORMALS_SHAPE
    energy = light * environment.solid_angles(*STORED_SHAPE)
    energy = energy.reshape(rows, 2, columns, 2).sum(axis=(1, 3)).reshape(-1)
    weights = _cosines()
    furnace = weights @ environment.solid_angles(*_NORMALS_SHAPE).reshape(-1)
    return (weights @ energy / furnace).reshape(_NORMALS_SHAPE)


@functools.cache
def _cosines() -> np.ndarray:
    """max(i·n, 0), `(2048, 2048)`, of all normals and lights of `_NORMALS_SHAPE`."""
    directions = environment.directions(*_NORMALS_SHAPE).reshape(-1, 3).astype(np.float32)
    return np.maximum(directions @ directions.T, 0)


def seen(evidence: Evidence) -> np.ndarray:
    """Which directions `(64, 128)` the object mirrors, more than half known."""
    return _filled(evidence)[1] < 0.5


def from_material(
    material: Material, normal: np.ndarray, camera: np.ndarray | None = None
) -> Evidence:
    """What an estimate's layers and the object's normals show of the light, in camera space.

    Args:
        material: with all layers, of one photo.
        normal: `(H, W, 3)` of `normal_map.read`, or roughly of `dome.normals`, at the layers' size.
        camera: fx, fy, cx, cy in pixels; by default `shading.assumed_camera`.

    Raises:
        ValueError: as `observe`, or if the material lacks a layer or its diffuse albedo.
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
