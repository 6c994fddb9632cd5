"""Reflectance maps: the image of a sphere of a material under a light, seen from afar.

Seen orthographically the viewer stays at o = (0, 0, 1), so a light's half vector h depends on the
light alone, and nothing in Eqs. 2 and 3 changes when normal and light turn about o together. In
polar coordinates about o, θ from it and φ around it, both shadings are therefore circular
convolutions along φ: a product for each pair of rings and each frequency. The energy of the stored
light is spread over a polar grid of half vectors, multiplied with the lobe there, and the shading
on the same grid of normals is read at the pixels; both ways by cubic interpolation.

`keras.ops` throughout, so that a training step of any backend can make its targets.
"""

import functools
import math
from typing import Any

import numpy as np
from keras import ops

from lime_keras.optics.compositing import compose
from lime_keras.optics.environment import STORED_SHAPE, directions, solid_angles
from lime_keras.optics.shading import normaliser

_RINGS = 64
"""Of a quarter turn of θ: at s = 1000 the lobe's standard deviation is 1.3 of them."""
_MARGIN = 2
"""Rings beyond the quarter turn, where the shading goes on smoothly, for the interpolation."""
_ANGLES = 256
"""Of a full turn of φ."""
_LARGEST_EXPONENT = 1000.0
_UNLIT = -1e30
"""Stands for log 0: finite, so that no exponent makes it NaN."""


def reflectance_map(
    environment: Any,
    shininess: Any,
    diffuse_albedo: Any,
    specular_albedo: Any,
    ambient: Any,
    size: int,
) -> Any:
    """Linear radiance of Eq. 4 on a sphere, not clipped, shading normalised to the white furnace.

    Pixel centres (u, v), u to the right and v up, show the normal (u, v, √(1 − u² − v²)). The
    examples are shaded one after the other, 2 MB each, so memory hardly grows with the batch.
    No gradients are meant to be taken.

    Args:
        environment: the light in camera space, `(B, 64, 128, 1)`, linear radiance, at least 0.
        shininess: exponent s, `(B,)`, at least 0. Above 1000 it counts as 1000, whose lobe is
            about as narrow as a texel of the light.
        diffuse_albedo: m_d, `(B, 3)`, linear, in [0, 1].
        specular_albedo: m_s, `(B,)`, in [0, 1].
        ambient: m_a, `(B,)`, radiance.
        size: height and width of the map.

    Returns:
        `(B, size, size, 3)`, top row first, 0 outside `disc(size)`.
    """
    composed = compose(
        ops.cast(diffuse_albedo, "float32"),
        ops.cast(specular_albedo, "float32"),
        ops.cast(ambient, "float32"),
        *sphere_shading(environment, shininess, size),
    )
    return composed * ops.convert_to_tensor(disc(size))


def sphere_shading(environment: Any, shininess: Any, size: int) -> tuple[Any, Any]:
    """D and S of a sphere seen from afar, furnace-normalised: what Eq. 4 composes here.

    Args:
        environment: as for `reflectance_map`.
        shininess: as for `reflectance_map`.
        size: height and width of the images.

    Returns:
        Linear radiance `(B, size, size, 1)` each; beside `disc(size)` it means nothing.
    """
    exponent = ops.minimum(ops.cast(ops.reshape(shininess, (-1,)), "float32"), _LARGEST_EXPONENT)
    shading = ops.map(lambda one: _shading(one[0], one[1], size), (_energy(environment), exponent))
    lobe_scale = ops.reshape(normaliser(exponent), (-1, 1, 1, 1))
    return shading[..., :1], shading[..., 1:] * lobe_scale


def disc(size: int) -> np.ndarray:
    """1 where the centre of a pixel shows the sphere, else 0, `(size, size, 1)` float32."""
    u, v = _centres(size)
    return (u**2 + v**2 <= 1).astype(np.float32)[..., None]


def _energy(radiance: Any) -> Any:
    """Energies `(B, rings, angles)` of maps `(B, 64, 128, 1)` on the grid of half vectors."""
    node, weight = _spread()
    texels = ops.reshape(ops.cast(radiance, "float32"), (-1, len(node)))
    # A row for each corner and texel, a column for each example.
    shares = ops.expand_dims(ops.transpose(texels), 1) * weight[..., None]
    shares = ops.reshape(shares, (node.size, -1))
    rings = _RINGS + _MARGIN
    spread = ops.segment_sum(shares, node.reshape(-1), num_segments=rings * _ANGLES)
    return ops.reshape(ops.transpose(spread), (-1, rings, _ANGLES))


def _shading(energy: Any, exponent: Any, size: int) -> Any:
    """D and S / c(s), `(size, size, 2)`, of one example's energies `(rings, angles)`."""
    rings, frequencies = _RINGS + _MARGIN, _ANGLES // 2 + 1
    log_lobe, diffuse = _kernels()
    analysis, synthesis, even = _fourier()
    # At s = 0 the lobe is still dark where i·n ≤ 0.
    lobe = ops.exp(ops.maximum(exponent, 1e-6) * log_lobe)
    specular = ops.reshape(ops.matmul(even, lobe), (frequencies, rings, rings))
    waves = ops.reshape(ops.matmul(energy, analysis), (rings, 2, frequencies))
    waves = ops.transpose(waves, (2, 0, 1))
    shaded = ops.stack([ops.matmul(diffuse, waves), ops.matmul(specular, waves)])
    shaded = ops.reshape(ops.transpose(shaded, (0, 2, 3, 1)), (2 * rings, 2 * frequencies))
    polar = ops.reshape(ops.matmul(shaded, synthesis), (2, rings * _ANGLES))
    node, weight = _pixels(size)
    found = ops.take(ops.transpose(ops.maximum(polar, 0.0)), node, axis=0)
    value = ops.sum(found * weight[..., None], axis=1)
    # A cubic dips below its nodes at the foot of a highlight; the four around the pixel do not.
    value = ops.maximum(value, ops.min(ops.take(found, [5, 6, 9, 10], axis=1), axis=1))
    return ops.reshape(value, (size, size, 2))


@functools.cache
def _kernels() -> tuple[np.ndarray, np.ndarray]:
    """The lobes between rings of normals (first) and of half vectors (second).

    Returns:
        log(h·n), or a very negative number where i·n ≤ 0, by difference of angle:
        `(angles / 2 + 1, rings · rings)`; and max(i·n, 0) / π, by frequency:
        `(angles / 2 + 1, rings, rings)`.
    """
    theta = (np.arange(_RINGS + _MARGIN) + 0.5) * (math.pi / 2 / _RINGS)
    phi = np.arange(_ANGLES // 2 + 1) * (2 * math.pi / _ANGLES)

    def cosines(half_turn: float) -> np.ndarray:
        n, other = theta[:, None], half_turn * theta[None, :]
        return np.cos(n) * np.cos(other) + np.sin(n) * np.sin(other) * np.cos(phi)[:, None, None]

    # The light lies in the half vector's half-plane, at twice its angle to the viewer.
    h_n, i_n = cosines(1), cosines(2)
    log = np.where((i_n > 0) & (h_n > 0), np.log(np.maximum(h_n, 1e-30)), _UNLIT)
    even = _fourier()[2].astype(np.float64)
    diffuse = np.tensordot(even, np.maximum(i_n, 0) / math.pi, axes=1)
    return log.reshape(len(phi), -1).astype(np.float32), diffuse.astype(np.float32)


@functools.cache
def _fourier() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Discrete Fourier transforms as matrices, which every backend multiplies fast.

    Returns:
        angles to cosine and then sine waves; back again; and, of an even function given over half
        the turn, its cosine waves.
    """
    frequency = np.arange(_ANGLES // 2 + 1)
    phi = np.arange(_ANGLES) * (2 * math.pi / _ANGLES)
    twice = np.where(frequency % (_ANGLES // 2) == 0, 1.0, 2.0)
    cosine, sine = np.cos(np.outer(phi, frequency)), np.sin(np.outer(phi, frequency))
    analysis = np.concatenate([cosine, sine], axis=1)
    synthesis = (analysis * np.tile(twice, 2)).T / _ANGLES
    even = (cosine[: len(frequency)] * twice[:, None]).T
    return analysis.astype(np.float32), synthesis.astype(np.float32), even.astype(np.float32)


@functools.cache
def _spread() -> tuple[np.ndarray, np.ndarray]:
    """Nodes `(T, 16)` over which a stored light's T texels spread, and solid angle times share."""
    node, weight = _nodes(directions(*STORED_SHAPE).reshape(-1, 3), 0.5)
    weight = weight * solid_angles(*STORED_SHAPE).reshape(-1, 1)
    return node, weight.astype(np.float32)


@functools.cache
def _pixels(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes between which each pixel of the map lies, and their shares, `(size², 16)`."""
    u, v = _centres(size)
    # Pixels beside the sphere are read at its rim, and hidden afterwards.
    z = np.sqrt(np.maximum(1 - u**2 - v**2, 0))
    node, weight = _nodes(np.stack([u, v, z], axis=-1).reshape(-1, 3), 1.0)
    return node, weight.astype(np.float32)


def _nodes(direction: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """The 4 × 4 nodes of the polar grid around directions, and cubic weights, both `(N, 16)`.

    Args:
        direction: `(N, 3)`, of any length above 0.
        scale: of the angle to the viewer: ½ takes a light to its half vector.
    """
    x, y, z = direction.T
    ring, ring_share = _cubic(scale * np.arctan2(np.hypot(x, y), z) * (2 * _RINGS / math.pi) - 0.5)
    angle, angle_share = _cubic(np.arctan2(y, x) * (_ANGLES / (2 * math.pi)))
    ring, angle = ring[:, :, None], angle[:, None, :]
    # Before the first ring comes the first again, on the far side of the viewer's axis.
    angle = (angle + (ring < 0) * (_ANGLES // 2)) % _ANGLES
    ring = np.where(ring < 0, -1 - ring, ring)
    node = (ring * _ANGLES + angle).reshape(len(direction), 16)
    weight = (ring_share[:, :, None] * angle_share[:, None, :]).reshape(node.shape)
    return node.astype(np.int32), weight


def _cubic(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The four samples around positions `(N,)`, and Lagrange's weights for them, both `(N, 4)`."""
    before = np.floor(position).astype(np.int64)
    t = position - before
    weights = [
        t * (1 - t) * (t - 2) / 6,
        (1 - t * t) * (2 - t) / 2,
        t * (1 + t) * (2 - t) / 2,
        t * (t * t - 1) / 6,
    ]
    return before[:, None] + np.arange(-1, 3), np.stack(weights, axis=-1)


def _centres(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates u and v, in [−1, 1], of the pixel centres, each `(size, size)`."""
    u = (2 * np.arange(size) + 1) / size - 1
    return np.meshgrid(u, -u)
