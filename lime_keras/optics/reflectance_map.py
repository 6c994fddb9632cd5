"""Reflectance maps: the image of a sphere of a material under a light, seen from afar.

The camera is orthographic, so the direction to the viewer is o = (0, 0, 1) for every pixel. A
light's half vector h then depends on the light alone, and Eqs. 2 and 3 do not change when normal
and light turn about o together. In polar coordinates about o, with θ the angle to o and φ the angle
around o, both shadings are therefore circular convolutions along φ: one product for each pair of
rings and each frequency. The energy of the stored light is spread over a polar grid of half vectors
and multiplied with the lobe there. The result is the shading on the same grid of normals, which is
read at the pixels. Spreading and reading use cubic interpolation.

Everything is written for NumPy arrays and for tensors in `keras.ops`, so a training step of any
backend can compute its targets, and a preview needs no Keras.
"""

import functools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from lime_keras.optics.compositing import compose
from lime_keras.optics.environment import STORED_SHAPE, directions, solid_angles
from lime_keras.optics.namespace import namespace
from lime_keras.optics.shading import normaliser

_RINGS = 64  # number of rings in a quarter turn of θ; at s = 1000 the lobe's deviation is 1.3 rings
_MARGIN = 2  # number of rings beyond the quarter turn; the interpolation needs the shading there
_ANGLES = 256  # number of angles in a full turn of φ
_LARGEST_EXPONENT = 1000.0
_UNLIT = -1e30  # value in place of log 0: finite, so that no exponent makes it NaN


def true_reflectance_map(batch: Mapping[str, Any]) -> Any:
    """Return the linear radiance of Eq. 4 on a sphere, not clipped, for each example of a batch.

    D and S are normalised to the white furnace. The pixel whose centre is (u, v), u to the right
    and v up, shows the normal (u, v, √(1 − u² − v²)). The examples are shaded one after the other,
    2 MB each, so memory hardly grows with the batch. The function is not meant for gradients. It
    checks neither shapes nor ranges.

    Args:
        batch: features by the names of `data.pipeline`: the light `(B, 64, 128, 1)`, linear
            radiance in camera space; the whole material; and the mask `(B, S, S, 1)`, whose size S
            the map has. An exponent above 1000 counts as 1000, whose lobe is about as narrow as a
            texel of the light.

    Returns:
        Linear RGB radiance `(B, S, S, 3)`, top row first, 0 outside `disc(S)`.
    """
    size = batch["mask"].shape[1]
    composed = compose(
        _single(batch["diffuse_albedo"]),
        _single(batch["specular_albedo"]),
        _single(batch["ambient"]),
        *sphere_shading(batch["environment"], batch["shininess"], size),
    )
    return composed * disc(size)


def sphere_shading(environment: Any, shininess: Any, size: int) -> tuple[Any, Any]:
    """Return D and S of a sphere seen from afar, normalised to the white furnace.

    Args:
        environment: light in camera space, linear radiance `(B, 64, 128, 1)`, at least 0.
        shininess: exponent s, `(B,)`, at least 0; above 1000 it counts as 1000.
        size: height and width of the images in pixels.

    Returns:
        D and S, each linear radiance `(B, size, size, 1)`; the values outside `disc(size)` have no
        meaning.
    """
    xp = namespace(environment, shininess)
    exponent = xp.minimum(xp.reshape(_single(shininess), (-1,)), _LARGEST_EXPONENT)
    energy = _energy(environment)
    if xp is np:
        shading = np.stack([_shading(*one, size) for one in zip(energy, exponent, strict=True)])
    else:
        shading = xp.map(lambda one: _shading(one[0], one[1], size), (energy, exponent))
    lobe_scale = xp.reshape(normaliser(exponent), (-1, 1, 1, 1))
    return shading[..., :1], shading[..., 1:] * lobe_scale


def _single(values: Any) -> Any:
    """Return values in single precision, arrays and tensors alike."""
    xp = namespace(values)
    return np.asarray(values, np.float32) if xp is np else xp.cast(values, "float32")


def disc(size: int) -> np.ndarray:
    """Return `(size, size, 1)` float32, 1 where a pixel's centre shows the sphere, else 0."""
    u, v = _centres(size)
    return (u**2 + v**2 <= 1).astype(np.float32)[..., None]


def _energy(radiance: Any) -> Any:
    """Return the energies `(B, rings, angles)`, on half vectors, of maps `(B, 64, 128, 1)`."""
    xp = namespace(radiance)
    node, weight = _spread()
    texels = xp.reshape(_single(radiance), (-1, len(node)))
    # A row for each corner and texel, a column for each example.
    shares = xp.expand_dims(xp.transpose(texels), 1) * weight[..., None]
    shares = xp.reshape(shares, (node.size, -1))
    rings = _RINGS + _MARGIN
    if xp is np:
        spread = np.zeros((rings * _ANGLES, shares.shape[1]), np.float32)
        np.add.at(spread, node.reshape(-1), shares)
    else:
        spread = xp.segment_sum(shares, node.reshape(-1), num_segments=rings * _ANGLES)
    return xp.reshape(xp.transpose(spread), (-1, rings, _ANGLES))


def _shading(energy: Any, exponent: Any, size: int) -> Any:
    """Return D and S / c(s), `(size, size, 2)`, of one example's energies `(rings, angles)`."""
    xp = namespace(energy)
    rings, frequencies = _RINGS + _MARGIN, _ANGLES // 2 + 1
    log_lobe, diffuse = _kernels()
    analysis, synthesis, even = _fourier()
    # At s = 0 the lobe is still dark where i·n ≤ 0.
    lobe = xp.exp(xp.maximum(exponent, 1e-6) * log_lobe)
    specular = xp.reshape(xp.matmul(even, lobe), (frequencies, rings, rings))
    waves = xp.reshape(xp.matmul(energy, analysis), (rings, 2, frequencies))
    waves = xp.transpose(waves, (2, 0, 1))
    shaded = xp.stack([xp.matmul(diffuse, waves), xp.matmul(specular, waves)])
    shaded = xp.reshape(xp.transpose(shaded, (0, 2, 3, 1)), (2 * rings, 2 * frequencies))
    polar = xp.reshape(xp.matmul(shaded, synthesis), (2, rings * _ANGLES))
    node, weight = _pixels(size)
    around = xp.take(xp.transpose(xp.maximum(polar, 0.0)), node, axis=0)
    value = xp.sum(around * weight[..., None], axis=1)
    # At the foot of a highlight the cubic falls below its nodes. The least of the four nodes around
    # the pixel is therefore the lower limit.
    value = xp.maximum(value, xp.min(xp.take(around, [5, 6, 9, 10], axis=1), axis=1))
    return xp.reshape(value, (size, size, 2))


@functools.cache
def _kernels() -> tuple[np.ndarray, np.ndarray]:
    """Return the lobes between the rings of normals and the rings of half vectors.

    Returns:
        The specular lobe: log(h·n), or a very negative number where i·n ≤ 0 or h·n ≤ 0, for each
        difference of φ, `(angles / 2 + 1, rings · rings)`. The diffuse lobe: max(i·n, 0) / π, for
        each frequency, `(angles / 2 + 1, rings, rings)`. Rings of normals come before rings of half
        vectors.
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
    """Return discrete Fourier transforms as matrices, which every backend multiplies fast.

    Returns:
        The transform from angles to cosine waves and then sine waves; its inverse; and the
        transform to cosine waves of an even function that is given over half a turn.
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
    """Return the 16 nodes of each texel of a stored light, and solid angle × weight, `(T, 16)`."""
    node, weight = _nodes(directions(*STORED_SHAPE).reshape(-1, 3), 0.5)
    weight = weight * solid_angles(*STORED_SHAPE).reshape(-1, 1)
    return node, weight.astype(np.float32)


@functools.cache
def _pixels(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the 16 nodes around each pixel of the map and their weights, both `(size², 16)`."""
    u, v = _centres(size)
    # Pixels beside the sphere are read at its rim; `disc` hides them afterwards.
    z = np.sqrt(np.maximum(1 - u**2 - v**2, 0))
    node, weight = _nodes(np.stack([u, v, z], axis=-1).reshape(-1, 3), 1.0)
    return node, weight.astype(np.float32)


def _nodes(direction: np.ndarray, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the 4 × 4 nodes of the polar grid around directions and cubic weights, `(N, 16)` each.

    Args:
        direction: `(N, 3)`, of any length above 0.
        scale: factor of the angle to the viewer; ½ takes a light to its half vector.
    """
    x, y, z = direction.T
    ring, ring_share = _cubic(scale * np.arctan2(np.hypot(x, y), z) * (2 * _RINGS / math.pi) - 0.5)
    angle, angle_share = _cubic(np.arctan2(y, x) * (_ANGLES / (2 * math.pi)))
    ring, angle = ring[:, :, None], angle[:, None, :]
    # Beyond the first ring lies the same ring again, on the other side of the viewer's axis.
    angle = (angle + (ring < 0) * (_ANGLES // 2)) % _ANGLES
    ring = np.where(ring < 0, -1 - ring, ring)
    node = (ring * _ANGLES + angle).reshape(len(direction), 16)
    weight = (ring_share[:, :, None] * angle_share[:, None, :]).reshape(node.shape)
    return node.astype(np.int32), weight


def _cubic(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the four samples around positions `(N,)` and their Lagrange weights, both `(N, 4)`."""
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
    """Return the coordinates u and v in [−1, 1] of the pixel centres, each `(size, size)`."""
    u = (2 * np.arange(size) + 1) / size - 1
    return np.meshgrid(u, -u)
