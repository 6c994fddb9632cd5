"""Tubes, wires and ribbons: sections swept along curves without twisting by themselves."""

import numpy as np

from . import parts
from .parts import Part

_END = np.array([0.0, 0.26, 0.5, 0.71, 0.87, 0.97, 0.999])  # heights of the rings of a round end


def swept(
    curve: np.ndarray,
    radius: np.ndarray,
    section: list[np.ndarray],
    closed: bool,
    turns: float = 0.0,
) -> Part:
    """Sweep a section along a curve.

    The section is carried without turning about the curve (a rotation-minimising frame); on a
    closed curve, what is left over is spread over the whole length, so that the ends meet.

    Args:
        curve: `(K, 3)`; of a closed one, the last point is not the first.
        radius: `(K,)`, factor of the section.
        section: outline around the origin, counter-clockwise, as smooth pieces `(M, 2)`, each of
            which begins where the one before it ended; the last ends where the first began.
        closed: whether the curve is closed; an open one gets flat ends.
        turns: turns of the section about the curve, from one end to the other; whole ones on a
            closed curve.

    Returns:
        A closed part, with creases between the pieces of the section.
    """
    tangent = _tangents(curve, closed)
    first, second = _frames(curve, tangent, closed, 2 * np.pi * turns)
    pieces, rows = [], []
    for piece in section:
        u, v = piece.T[..., None]
        offset = u[..., None] * first + v[..., None] * second  # (M, K, 3)
        points = (curve + radius[:, None] * offset).swapaxes(0, 1)  # (K, M, 3)
        normals = _normals(points, piece, first, second, closed).reshape(-1, 3)
        pieces.append((points.reshape(-1, 3), _grid(len(curve), len(piece), closed), normals))
        rows.append(points[:, :-1])
    if not closed:
        for end, side in ((0, -1), (-1, 1)):
            disc = np.concatenate([curve[end][None], *(row[end] for row in rows)])
            k = np.arange(len(disc) - 1)
            fan = np.stack([0 * k, k + 1, (k + 1) % len(k) + 1], 1)
            normals = np.repeat(side * tangent[end][None], len(disc), axis=0)
            pieces.append((disc, fan[:, ::side], normals))
    return parts.joined(pieces)


def tube(curve: np.ndarray, radius: np.ndarray | float, closed: bool, sides: int = 12) -> Part:
    """Return a round tube along a curve `(K, 3)`, with round ends."""
    radius = np.broadcast_to(np.asarray(radius, float), len(curve))
    if not closed:
        curve, radius = _round_ends(curve, radius)
    return swept(curve, radius, [circle(sides)], closed)


def circle(sides: int) -> np.ndarray:
    """Return the unit circle as a closed polyline `(sides + 1, 2)`."""
    angle = 2 * np.pi * np.arange(sides + 1) / sides
    outline = np.stack([np.cos(angle), np.sin(angle)], 1)
    outline[-1] = outline[0]
    return outline


def angular(corners: np.ndarray) -> list[np.ndarray]:
    """Return a polygon `(M, 2)` as pieces of one edge each, so that its corners are creases."""
    return [np.stack(edge) for edge in zip(corners, np.roll(corners, -1, axis=0), strict=True)]


def smooth(points: np.ndarray, count: int) -> np.ndarray:
    """Return `count` points along the open Catmull-Rom spline through points `(K, 3)`."""
    before, after = 2 * points[:1] - points[1:2], 2 * points[-1:] - points[-2:-1]
    padded = np.concatenate([before, points, after])
    return spline(padded, np.linspace(0, len(points) - 1, count))


def spline(padded: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return points `(N, D)` of the Catmull-Rom spline through points `(K, D)` but the outer two.

    Args:
        padded: the points, with one more before the first and after the last.
        t: places along the spline `(N,)`, from 0 at the first point to K − 3 at the last.
    """
    k = np.minimum(t.astype(int), len(padded) - 4)
    f = (t - k)[:, None]
    a, b, c, d = (padded[k + j] for j in range(4))
    quadratic = b + f * (c - a) / 2 + f**2 * (a - 2.5 * b + 2 * c - d / 2)
    return quadratic + f**3 * (1.5 * (b - c) + (d - a) / 2)


def even(curve: np.ndarray, count: int, closed: bool) -> np.ndarray:
    """Return `count` points along a polyline `(K, 3)`, at equal distances along it."""
    if closed:
        curve = np.concatenate([curve, curve[:1]])
    way = np.r_[0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))]
    at = np.linspace(0, way[-1], count, endpoint=not closed)
    return np.stack([np.interp(at, way, c) for c in curve.T], 1)


def tightest(curve: np.ndarray, closed: bool) -> float:
    """Return the least radius of curvature of a curve `(K, 3)`."""
    tangent = _tangents(curve, closed)
    following = np.roll(curve, -1, axis=0) - curve
    turning = np.roll(tangent, -1, axis=0) - tangent
    if not closed:
        following, turning = following[:-1], turning[:-1]
    bent, length = np.linalg.norm(turning, axis=1), np.linalg.norm(following, axis=1)
    return float((length / np.maximum(bent, 1e-6)).min())


def _tangents(curve: np.ndarray, closed: bool) -> np.ndarray:
    along = _along(curve, closed)
    return along / np.linalg.norm(along, axis=1, keepdims=True)


def _along(points: np.ndarray, closed: bool) -> np.ndarray:
    """Return the direction of a row of points `(K, ...)` at each, of any length."""
    if closed:
        return np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    return np.gradient(points, axis=0)


def _frames(
    curve: np.ndarray, tangent: np.ndarray, closed: bool, angle: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit normals of the curve, `(K, 3)` each, by the double reflection method.

    Wang et al., "Computation of rotation minimizing frames" (2008).
    """
    steps = np.roll(curve, -1, axis=0) - curve
    normal = parts.frame_along(tangent[0])[:, 0]
    carried = [normal]
    for k in range(len(curve) - (not closed)):
        step, ahead = steps[k], tangent[(k + 1) % len(curve)]
        scale = 2 / (step @ step)
        mirrored = normal - scale * (step @ normal) * step
        turned = tangent[k] - scale * (step @ tangent[k]) * step
        second = ahead - turned
        size = second @ second
        normal = mirrored - (2 / size * (second @ mirrored) * second if size > 1e-18 else 0)
        carried.append(normal)
    first = np.array(carried[: len(curve)])
    other = np.cross(tangent, first)
    share = np.arange(len(curve)) / (len(curve) - (not closed))
    if closed:  # carried once around, the normal has turned by this angle
        angle -= np.arctan2(carried[-1] @ other[0], carried[-1] @ first[0])
    c, s = np.cos(angle * share)[:, None], np.sin(angle * share)[:, None]
    return c * first + s * other, c * other - s * first


def _normals(
    points: np.ndarray, piece: np.ndarray, first: np.ndarray, second: np.ndarray, closed: bool
) -> np.ndarray:
    """Return the outward normals `(K, M, 3)` of a swept piece: across the section times along."""
    ring = np.array_equal(piece[0], piece[-1])
    step = _along(piece[:-1] if ring else piece, ring)
    step = np.concatenate([step, step[:1]]) if ring else step
    across = step[:, :1] * first[:, None] + step[:, 1:] * second[:, None]
    return np.cross(across, _along(points, closed))


def _grid(rows: int, columns: int, closed: bool) -> np.ndarray:
    """Return the triangles between the points of a grid; its last row meets the first if closed."""
    row, column = np.mgrid[: rows - (not closed), : columns - 1].reshape(2, -1)
    a, b = row * columns + column, (row + 1) % rows * columns + column
    return np.concatenate([np.stack([a, a + 1, b], 1), np.stack([a + 1, b + 1, b], 1)])


def _round_ends(curve: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lengthen a curve at both ends by rings that shrink to a point."""
    tangent = _tangents(curve, False)
    shrink = np.sqrt(1 - _END[1:, None] ** 2)
    start = curve[0] - radius[0] * _END[1:, None] * tangent[0]
    end = curve[-1] + radius[-1] * _END[1:, None] * tangent[-1]
    rings = shrink[:, 0]
    return (
        np.concatenate([start[::-1], curve, end]),
        np.concatenate([rings[::-1] * radius[0], radius, rings * radius[-1]]),
    )
