"""The parts of rooms, panels and solids, and their triangles.

Lengths are in metres; Y is up.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..shapes.parts import Part, joined
from ..shapes.smoothing import face_normals

MATTE = 1.0  # roughness of what has no glossy coat


class Piece(NamedTuple):
    """The triangles of a part of a room, with each face's albedo and roughness."""

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    albedo: np.ndarray
    roughness: np.ndarray


@dataclass(frozen=True)
class Panel:
    """A rectangle divided into cells, visible from the side of `across` x `up`.

    Attributes:
        corner: The lower left corner, `(3,)`.
        across: The edge from the corner to the right.
        up: The edge from the corner upwards.
        cells: The albedo of each cell, `(rows, columns)` from the bottom; 0 for a light.
    """

    corner: ArrayLike
    across: ArrayLike
    up: ArrayLike
    cells: ArrayLike


def panel_piece(panel: Panel) -> Piece:
    """Return the triangles of a panel, two for each cell."""
    cells = np.array(panel.cells)
    rows, columns = cells.shape
    across, up = np.array(panel.across), np.array(panel.up)
    i, j = np.mgrid[:rows, :columns].reshape(2, -1, 1)
    v = np.stack([i, i, i + 1, i + 1], 1) / rows
    u = np.stack([j, j + 1, j + 1, j], 1) / columns
    vertices = (np.array(panel.corner) + u * across + v * up).reshape(-1, 3)
    normal = np.cross(across, up)
    normals = np.broadcast_to(normal / np.linalg.norm(normal), vertices.shape)
    first = 4 * np.arange(cells.size)[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    albedo = np.repeat(cells.ravel(), 2)
    return Piece(vertices, faces, normals, albedo, np.full(len(faces), MATTE))


def solid(
    kind: str,
    centre: ArrayLike,
    extent: ArrayLike,
    turn: float = 0.0,
    albedo: float = 0.0,
    roughness: float = MATTE,
) -> Piece:
    """Return the triangles of a solid: those of its unit solid, scaled, turned and moved.

    Args:
        kind: "box", "cylinder" (upright), "tube" (lying) or "sphere" (an ellipsoid).
        centre: Centre of the bounding box, `(3,)`.
        extent: Half extents along the solid's own axes, `(3,)`.
        turn: Rotation about the vertical in radians.
        albedo: Albedo between 0 and 1; 0 for a lamp.
        roughness: Roughness of a glossy coat, below `MATTE`; by default there is no coat.
    """
    vertices, faces, normals = _unit(kind)
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    normals = normals / np.array(extent)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    surface = np.full((2, len(faces)), [[albedo], [roughness]])
    return Piece((vertices * extent) @ matrix + centre, faces, normals @ matrix, *surface)


@lru_cache
def _unit(kind: str) -> Part:
    """Return the vertices, faces and normals of a solid of half extents 1."""
    if kind == "box":
        v, f, n, *_ = panel_piece(Panel((-1, -1, 1), (2, 0, 0), (0, 2, 0), [[0]]))
        turns = [np.eye(3)[list(p)] * np.array(q)[:, None] for p, q in _BOX_TURNS]
        return joined([(v @ t.T, f, n @ t.T) for t in turns])
    columns = 24
    if kind == "sphere":
        angle = np.linspace(0, np.pi, 13)
        rings = np.stack([np.sin(angle), -np.cos(angle)], 1)
        return _lathed(rings, rings, columns)
    rim, zero, one = np.array([1.0, 1.0]), np.zeros(2), np.array([[0.0, 1.0]])
    wall = _lathed(np.array([[1.0, -1.0], rim]), np.array([[1.0, 0.0]] * 2), columns)
    top = _lathed(np.array([rim, zero + one[0]]), np.repeat(one, 2, 0), columns)
    bottom = _lathed(np.array([-one[0], [1.0, -1.0]]), np.repeat(-one, 2, 0), columns)
    vertices, faces, normals = joined([wall, top, bottom])
    if kind == "tube":  # lies along x
        axes = [1, 2, 0]
        return vertices[:, axes], faces, normals[:, axes]
    return vertices, faces, normals


_BOX_TURNS = (
    ((0, 1, 2), (1, 1, 1)),
    ((0, 1, 2), (-1, 1, -1)),
    ((2, 1, 0), (1, 1, -1)),
    ((2, 1, 0), (-1, 1, 1)),
    ((0, 2, 1), (1, 1, -1)),
    ((0, 2, 1), (1, -1, 1)),
)  # permutation and signs of the rotations that turn the front of a box to each of its sides


def _lathed(rings: np.ndarray, slopes: np.ndarray, columns: int) -> Part:
    """Revolve points `(K, 2)` of radius and height, and their normals, about y."""
    angle = 2 * np.pi * np.arange(columns) / columns
    around = np.stack([np.cos(angle), np.ones(columns), -np.sin(angle)], 1)
    vertices = (rings[:, None, [0, 1, 0]] * around).reshape(-1, 3)
    normals = (slopes[:, None, [0, 1, 0]] * around).reshape(-1, 3)
    i, j = np.mgrid[: len(rings) - 1, :columns].reshape(2, -1)
    a, b = i * columns + j, i * columns + (j + 1) % columns
    lower = np.stack([a, b, b + columns], 1)[rings[i, 0] > 1e-9]
    upper = np.stack([a, b + columns, a + columns], 1)[rings[i + 1, 0] > 1e-9]
    return vertices, np.concatenate([lower, upper]), normals


def area(piece: Piece) -> float:
    """Return the area of all faces of a piece."""
    doubled = np.linalg.norm(face_normals(piece.vertices, piece.faces), axis=1)
    return float(doubled.sum() / 2)
