"""Parts of a mesh: surfaces of exact solids, placed and joined.

A part is what `meshes.normalised` takes: vertices `(V, 3)`, faces `(F, 3)` and normals `(V, 3)`;
parts of rooms have more (`rooms.panels.Piece`).
Unions, differences and intersections of solids with sharp edges are left to Manifold, whose
results are closed by construction.
"""

from collections.abc import Sequence

import numpy as np
from manifold3d import Manifold

Part = tuple[np.ndarray, ...]

CREASE = 38.0  # angle in degrees: faces that meet at a larger one keep separate normals


def of_solid(solid: Manifold) -> Part:
    """Return the surface of a solid; it has creases between faces at more than `CREASE` degrees."""
    mesh = solid.calculate_normals(0, CREASE).to_mesh()
    values = np.asarray(mesh.vert_properties)
    return values[:, :3], np.asarray(mesh.tri_verts), values[:, 3:6]


def joined(parts: Sequence[Part]) -> Part:
    """Return several parts as one; they may overlap or lie apart.

    What comes after vertices and faces, normals and more, is only put in a row.
    """
    vertices, faces, *values = zip(*parts, strict=True)
    starts = np.cumsum([0, *map(len, vertices)])
    shifted = [f.astype(int) + start for f, start in zip(faces, starts, strict=False)]
    return tuple(map(np.concatenate, (vertices, shifted, *values)))


def direction(rng: np.random.Generator) -> np.ndarray:
    """Draw a direction `(3,)`, uniform over the sphere."""
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def turn(rng: np.random.Generator) -> np.ndarray:
    """Draw a rotation `(3, 3)`, uniform over all orientations."""
    matrix, triangle = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix = matrix * np.sign(np.diag(triangle))
    return matrix * np.linalg.det(matrix)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform between those of `low` and `high`."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def frame_along(axis: np.ndarray) -> np.ndarray:
    """Return a rotation `(3, 3)` whose third column is the unit vector `axis`."""
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across = across / np.linalg.norm(across)
    return np.stack([across, np.cross(axis, across), axis], axis=1)


def placed(solid: Manifold, rotation: np.ndarray, move: np.ndarray) -> Manifold:
    """Return a solid after a rotation `(3, 3)` and a translation `(3,)`."""
    return solid.transform(np.column_stack([rotation, move]))
