"""D, S and M of Eqs. 1–3 for batches of scenes, in `keras.ops`, on the device that trains.

A light is a pyramid: the map's texels, and sums over 2 × 2 texels again and again. A texel is a
light of its energy E(i) di in the energy's mean direction, so a lamp stays where it is at every
level. S of a pixel is the sum over the texels of one level, the coarsest on which a texel is small
beside the lobe (`rows_for`). D is summed in the same pass: its texels count with their first moment
∫ i E(i) di, for which i·n is exact. M is looked up, as in a texture with mip maps, between the two
levels whose texels are as wide as the bundle of mirror directions that the pixel sees.

A pixel that sees a bent surface sees normals that vary. Their variance widens the lobe of S:
1/s grows by the variance of the normals about each axis.

A pixel at an edge or a crease sees two surfaces, each with a normal, a variance and a share. Only
what is covered is computed: the host lists the surfaces in pieces of `PIECE` (`Pieces`), those of
one level together, and the device works through as many as there are.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from keras import ops

from lime_keras.optics import environment
from lime_keras.optics.shading import normaliser

from . import panorama

LEVEL_ROWS = (16, 32, 64, 128)
"""Rows of the levels over which S is summed, coarsest first."""
COARSENESS = 4.0
"""Largest (texel's height in radians)² · (s + 2) of the level that S is summed over; the lobe's own
variance about the half vector is 1/(s + 2). `benchmarks/synthesis_error.py` draws error against
cost."""
PIECE = 1024
"""Number of surfaces that are lit at once: few enough for a processor's cache."""
_COARSEST_MIRROR = 4
"""Rows of the coarsest level in which M is looked up."""
_LEAST_SQUARE = 1e-20
"""Least (h·n)² whose power is computed; at s = 0 and s = 1 what is below contributes nothing."""


def rows_for(exponent: np.ndarray, coarseness: float = COARSENESS) -> np.ndarray:
    """Return the index in `LEVEL_ROWS` of the level over which S is summed, for exponents s.

    Args:
        exponent: s, at least 0, of any shape.
        coarseness: largest (texel's height)² · (s + 2).
    """
    rows = math.pi * np.sqrt((np.asarray(exponent) + 2.0) / coarseness)
    return np.minimum(np.searchsorted(LEVEL_ROWS, rows * (1 - 1e-6)), len(LEVEL_ROWS) - 1)


class Pieces(NamedTuple):
    """The surfaces that the pixels of a batch see, in pieces of `PIECE` surfaces of one scene each.

    A pixel sees one surface, two, or none. The arrays have room for a batch in which every pixel
    sees two, so their shapes depend on the batch's shape alone.

    Attributes:
        surfaces: row-major indices into `(B, 2, S, S)`, `(P · PIECE,)` int32; the last piece of a
            scene is filled up by repetition.
        scenes: scene of each piece, `(P,)` int32.
        ends: number of pieces of the first level, of the first two levels, and so on, `(4,)` int32.
        places: for each entry of `(B, 2, S, S)`, its index in `surfaces`, `(B · 2 · S · S,)` int32;
            P · PIECE where there is no surface.
    """

    surfaces: np.ndarray
    scenes: np.ndarray
    ends: np.ndarray
    places: np.ndarray


def pieces(there: np.ndarray, exponent: np.ndarray, coarseness: float = COARSENESS) -> Pieces:
    """List the surfaces of a batch, for `layers`.

    Args:
        there: whether a pixel sees a first and a second surface, `(B, 2, S, S)`.
        exponent: s of each scene, `(B,)`, at least 0.
        coarseness: see `rows_for`.
    """
    batch, room = len(there), there[0].size
    most = batch * -(-room // PIECE)
    surfaces = np.zeros((most, PIECE), np.int32)
    scenes = np.zeros(most, np.int32)
    places = np.full(batch * room, most * PIECE, np.int32)
    level = rows_for(exponent, coarseness)
    ends, count = [], 0
    for index in range(len(LEVEL_ROWS)):
        for scene in np.flatnonzero(level == index):
            found = np.flatnonzero(there[scene]) + scene * room
            used = -(-len(found) // PIECE)
            surfaces[count : count + used].reshape(-1)[:] = np.resize(found, used * PIECE)
            scenes[count : count + used] = scene
            places[found] = count * PIECE + np.arange(len(found))
            count += used
        ends.append(count)
    return Pieces(surfaces.reshape(-1), scenes, np.array(ends, np.int32), places)


def layers(
    normal: Any,
    variance: Any,
    share: Any,
    camera: Any,
    radiance: Any,
    rotation: Any,
    exponent: Any,
    work: Pieces,
) -> tuple[Any, Any, Any]:
    """Compute D, S and M of a batch of scenes, furnace-normalised linear radiance.

    Args:
        normal: n, unit, in camera space, of the first and second surface that each pixel sees,
            `(B, 2, S, S, 3)` float32.
        variance: variance of the mirror directions on each surface within the pixel,
            `(B, 2, S, S)`, at least 0.
        share: share of the covered part of the pixel that shows its first surface, `(B, S, S)`.
        camera: fx, fy, cx, cy in pixels, `(B, 4)`.
        radiance: E, linear radiance in the map's frame, `(B, H, 2 H)` with H = 128 or a greater
            power of two, at least 0.
        rotation: rotations `(B, 3, 3)` from the map's frame to camera space.
        exponent: s, at least 0, `(B,)`.
        work: the surfaces, from `pieces`.

    Returns:
        D, S and M, each `(B, S, S, 1)` float32, 0 where a pixel sees no surface.
    """
    batch, _, size, _, _ = normal.shape
    # Light: levels for S, mip maps for M.
    levels = _pyramid(radiance)
    mips = _mips(levels)
    to_map = ops.transpose(rotation, (0, 2, 1))
    # Surfaces: only what is covered, in pieces.
    known = ops.concatenate([ops.reshape(normal, (-1, 3)), ops.reshape(variance, (-1, 1))], axis=1)
    known = ops.transpose(ops.take(known, work.surfaces, axis=0))
    out = ops.zeros((3, known.shape[1]), "float32")
    first: Any = ops.convert_to_tensor(0, "int32")
    for index, rows in enumerate(LEVEL_ROWS):
        lights, limit = levels[rows], work.ends[index]

        def step(piece: Any, out: Any, lights: Any = lights) -> tuple[Any, Any]:
            start = piece * PIECE
            part = ops.slice(known, (0, start), (4, PIECE))
            pixel = ops.slice(work.surfaces, (start,), (PIECE,)) % (size * size)
            scene = ops.take(work.scenes, piece)
            turn = ops.take(to_map, scene, axis=0)
            towards = _view(pixel, ops.take(camera, scene, axis=0), size)
            n, o = ops.matmul(turn, part[:3]), ops.matmul(turn, towards)
            widened = _widened(ops.take(exponent, scene), part[3])
            found = ops.stack(
                [
                    *_diffuse_and_specular(n, o, widened, ops.take(lights, scene, axis=0)),
                    _mirror(n, o, part[3], mips, scene),
                ]
            )
            return piece + 1, ops.slice_update(out, (0, start), found)

        def more(piece: Any, _: Any, limit: Any = limit) -> Any:
            return piece < limit

        first, out = ops.while_loop(more, step, (first, out))
    # Images: each pixel mixes its two surfaces.
    nothing = ops.zeros((3, 1), "float32")
    found = ops.take(ops.concatenate([out, nothing], axis=1), work.places, axis=1)
    found = ops.reshape(found, (3, batch, 2, size, size, 1))
    share = share[..., None]
    images = found[:, :, 0] * share + found[:, :, 1] * (1.0 - share)
    return images[0], images[1], images[2]


def _view(pixel: Any, camera: Any, size: int) -> Any:
    """Return o in camera space, `(3, N)`, at the centres of pixels with row-major indices."""
    column = ops.cast(pixel % size, "float32") + 0.5
    row = ops.cast(pixel // size, "float32") + 0.5
    x, y = (camera[2] - column) / camera[0], (row - camera[3]) / camera[1]
    length = ops.sqrt(ops.square(x) + ops.square(y) + 1.0)
    return ops.stack([x / length, y / length, 1.0 / length])


def _widened(exponent: Any, variance: Any) -> Any:
    """Return the exponents `(N,)` of lobes widened by the variance of the mirror directions.

    A mirror direction turns twice as far as its normal and varies about two axes, so the normals'
    variance about one axis is an eighth.
    """
    return exponent / (1.0 + exponent * (variance * 0.125))


def _diffuse_and_specular(n: Any, o: Any, exponent: Any, lights: Any) -> tuple[Any, Any]:
    """Return D and S, each `(N,)`, as sums over lights.

    Args:
        n: normals in the map's frame, `(3, N)`.
        o: directions to the viewer in the map's frame, `(3, N)`.
        exponent: s, `(N,)`.
        lights: direction (3), energy and length of the first moment of each light, `(5, T)`.
    """
    i, energy, moment = lights[:3, :, None], lights[3, :, None], lights[4, :, None]
    facing = i[0] * n[0] + i[1] * n[1] + i[2] * n[2]
    along = i[0] * o[0] + i[1] * o[1] + i[2] * o[2]
    cosine = n[0] * o[0] + n[1] * o[1] + n[2] * o[2]
    # (h·n)² = (i·n + o·n)² / |i + o|². Opposite directions i = −o have no half vector.
    square = ops.square(facing + cosine) / ops.maximum(2.0 + 2.0 * along, 1e-12)
    square = ops.clip(square, _LEAST_SQUARE, 1.0)
    lit = ops.logical_and(facing > 0, facing + cosine > 0)
    lobe = ops.exp((0.5 * exponent) * ops.log(square))
    specular = ops.sum(ops.where(lit, lobe, 0.0) * energy, axis=0) * normaliser(exponent)
    diffuse = ops.sum(ops.maximum(facing, 0.0) * moment, axis=0) / math.pi
    return diffuse, specular


def _mirror(n: Any, o: Any, variance: Any, mips: Any, scene: Any) -> Any:
    """Return M, `(N,)`: the radiance in the mirror directions, filtered by their variance.

    A bilinear look-up in texels of width w averages with a standard deviation of w / 2 about each
    axis, and the mirror directions vary by √(variance / 2): this is the width that is looked up.
    """
    stacked, rows, starts = mips
    mirrored = 2.0 * ops.sum(n * o, axis=0) * n - o
    u, v = panorama.place(mirrored[0], mirrored[1], mirrored[2])
    width = ops.sqrt(2.0 * ops.maximum(variance, 1e-9))
    finest = math.log2(rows[-1])
    level = finest - ops.log2(width * (rows[-1] / math.pi))
    level = ops.clip(level, math.log2(rows[0]), finest) - math.log2(rows[0])
    lower = ops.minimum(ops.floor(level), len(rows) - 2.0)
    share = level - lower
    texels = ops.take(stacked, scene, axis=0)
    index = ops.cast(lower, "int32")
    coarse = _bilinear(texels, u, v, index, rows, starts)
    return coarse + share * (_bilinear(texels, u, v, index + 1, rows, starts) - coarse)


def _bilinear(texels: Any, u: Any, v: Any, level: Any, rows: Any, starts: Any) -> Any:
    """Return the bilinear values `(N,)` at (u, v) of the level of each look-up."""
    height = ops.take(ops.convert_to_tensor(np.array(rows, np.int32)), level)
    start = ops.take(ops.convert_to_tensor(np.array(starts, np.int32)), level)
    high = ops.cast(height, "float32")
    column = u * (2.0 * high) - 0.5
    row = ops.clip(v * high - 0.5, 0.0, high - 1.0)
    left, top = ops.floor(column), ops.floor(row)
    across, down = column - left, row - top
    width = 2 * height
    left, top = ops.cast(left, "int32"), ops.cast(top, "int32")
    right, bottom = ops.mod(left + 1, width), ops.minimum(top + 1, height - 1)
    left = ops.mod(left, width)

    def at(row: Any, column: Any) -> Any:
        return ops.take(texels, start + row * width + column)

    upper = at(top, left) * (1.0 - across) + at(top, right) * across
    lower = at(bottom, left) * (1.0 - across) + at(bottom, right) * across
    return upper * (1.0 - down) + lower * down


def _pyramid(radiance: Any) -> dict[int, Any]:
    """Return the lights of each level by its rows, `(B, 5, T)`: see `_diffuse_and_specular`.

    Levels go from the map's own rows down to `_COARSEST_MIRROR`.
    """
    batch, height, width = radiance.shape
    around = environment.solid_angles(height, width)
    towards = environment.directions(height, width)
    weights = np.concatenate([towards, np.ones((height, width, 1))], axis=-1) * around[..., None]
    weights = np.moveaxis(weights, -1, 0).astype(np.float32)
    moments = radiance[:, None] * ops.convert_to_tensor(weights)
    levels = {}
    while True:
        levels[height] = _lights(moments, height)
        if height == _COARSEST_MIRROR:
            return levels
        height //= 2
        halves = ops.reshape(moments, (batch, 4, height, 2, 2 * height, 2))
        moments = ops.sum(halves, axis=(3, 5))


def _lights(moments: Any, height: int) -> Any:
    """Return direction, energy and length of the first moment of each texel, `(B, 5, T)`."""
    flat = ops.reshape(moments, (moments.shape[0], 4, -1))
    length = ops.sqrt(ops.sum(ops.square(flat[:, :3]), axis=1, keepdims=True))
    centres = environment.directions(height, 2 * height).reshape(-1, 3).T.astype(np.float32)
    towards = ops.where(length > 0, flat[:, :3] / ops.maximum(length, 1e-30), centres)
    return ops.concatenate([towards, flat[:, 3:], length], axis=1)


def _mips(levels: dict[int, Any]) -> tuple[Any, list[int], list[int]]:
    """Return the radiance of all levels one behind the other, `(B, ΣT)`; their rows and starts."""
    rows = sorted(levels)
    angles = [environment.solid_angles(r, 2 * r).reshape(-1).astype(np.float32) for r in rows]
    starts = [0, *np.cumsum([len(angle) for angle in angles])[:-1].tolist()]
    flat = [levels[r][:, 3] / ops.convert_to_tensor(a) for r, a in zip(rows, angles, strict=True)]
    return ops.concatenate(flat, axis=1), rows, starts
