"""Random deformations of meshes: stretch, shear, taper, twist, bend, and smooth waves.

A deformation is a chain of maps of space onto itself. Every map gives its Jacobian J, whose
determinant is positive everywhere in the unit ball, so that no part of a surface folds over or
turns inside out. Normals are moved by the cofactors of J, which are det(J) times its inverse
transpose, and stay exact where the surface was smooth.

Letters: `p` points (N, 3); `j` Jacobians (N, 3, 3) at these points.
"""

from collections.abc import Callable

import numpy as np

from .meshes import Mesh, normalised
from .subdivision import refined, rounded, softened

Map = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""A map of space: from points `(N, 3)` to moved points `(N, 3)` and Jacobians `(N, 3, 3)`."""

UNDEFORMED = 0.25
"""Share of the meshes that keep their shape."""
_LONGEST = 0.12
"""Longest edge of a mesh that is bent, in radii of its bounding sphere."""
_COARSE = 4_000
"""Number of faces below which a mesh may be rounded: its facets would show."""
_ROUNDED, _SOFTENED = 0.25, 0.2
"""Shares of the coarse meshes that are rounded, and whose edges are softened."""
_CREASE, _SOFT_CREASE = np.radians(55), np.radians(110)
"""Angles above which an edge of a rounded or softened mesh stays sharp, in radians."""


def deformed(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Bend, twist, taper, stretch, shear or warp a mesh at random; leave a quarter as they are.

    Long edges are divided first, so that flat faces of few vertices can take on curvature. Of the
    meshes of few faces, a quarter are rounded, as if their facets stood for a curved surface, and a
    fifth get soft edges.

    Args:
        mesh: Any normalised mesh, closed or not.
        rng: The only source of randomness; the same state gives the same mesh.

    Returns:
        A normalised mesh; or `mesh` itself.
    """
    if rng.random() < UNDEFORMED:
        return mesh
    maps = draw(rng)
    vertices, faces, normals = mesh.vertices.astype(float), mesh.faces, mesh.normals.astype(float)
    lot = rng.random() if len(faces) < _COARSE else 1.0
    if lot < _ROUNDED:
        vertices, faces, normals = rounded(vertices, faces, _CREASE, _LONGEST)
    elif lot < _ROUNDED + _SOFTENED:
        vertices, faces, normals = softened(vertices, faces, _SOFT_CREASE, 0.7 * _LONGEST)
    else:
        vertices, faces, normals = refined(vertices, faces, normals, _LONGEST)
    for step in maps:
        vertices, j = step(vertices)
        normals = turned(normals, j)
        # Each map expects the unit ball.
        middle = (vertices.min(0) + vertices.max(0)) / 2
        vertices = vertices - middle
        vertices = vertices / np.linalg.norm(vertices, axis=1).max()
    return normalised(vertices, faces, normals)


def draw(rng: np.random.Generator) -> list[Map]:
    """Draw one to three maps of different kinds, in random order."""
    kinds = [_stretch, _shear, _taper, _twist, _bend, _waves]
    count = rng.choice([1, 2, 3], p=(0.3, 0.4, 0.3))
    chosen = rng.choice(len(kinds), count, replace=False, p=(0.2, 0.1, 0.15, 0.15, 0.2, 0.2))
    return [kinds[k](rng) for k in chosen]


def turned(normals: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Return the unit normals of a surface after a map with Jacobians `j`."""
    a, b, c = j.swapaxes(0, 1).astype(float)  # rows
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    normals = np.einsum("nij,nj->ni", cofactors, normals)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _frame(rng: np.random.Generator) -> np.ndarray:
    """Draw a rotation `(3, 3)`: half of the draws only exchange the axes, as for made things."""
    if rng.random() < 0.5:
        return np.roll(np.eye(3), rng.integers(3), axis=0)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return turn * np.sign(np.linalg.det(turn))


def _in_frame(turn: np.ndarray, step: Map) -> Map:
    """Return a map that does in the frame of the rows of `turn` what `step` does in its own."""

    def turned_step(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q, j = step(p @ turn.T)
        return q @ turn, turn.T @ j @ turn

    return turned_step


def _linear(matrix: np.ndarray) -> Map:
    return lambda p: (p @ matrix.T, np.broadcast_to(matrix, (len(p), 3, 3)))


def _stretch(rng: np.random.Generator) -> Map:
    """Draw factors of 0.5 to 2 along three axes."""
    return _in_frame(_frame(rng), _linear(np.diag(np.exp2(rng.uniform(-1, 1, 3)))))


def _shear(rng: np.random.Generator) -> Map:
    matrix = np.eye(3)
    matrix[0, 1] = rng.uniform(-0.6, 0.6)
    return _in_frame(_frame(rng), _linear(matrix))


def _taper(rng: np.random.Generator) -> Map:
    """Draw a taper along z: x and y are scaled by 1 + k z, where |k| < 0.6."""
    kx, ky = rng.uniform(-0.6, 0.6, 2)
    if rng.random() < 0.6:
        ky = kx

    def step(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y, z = p.T
        j = np.zeros((len(p), 3, 3))
        j[:, 0, 0], j[:, 1, 1], j[:, 2, 2] = 1 + kx * z, 1 + ky * z, 1
        j[:, 0, 2], j[:, 1, 2] = kx * x, ky * y
        return np.stack([x * j[:, 0, 0], y * j[:, 1, 1], z], 1), j

    return _in_frame(_frame(rng), step)


def _twist(rng: np.random.Generator) -> Map:
    """Draw a twist about z, of up to 1.5 radians from the middle to an end."""
    rate = rng.choice([-1, 1]) * rng.uniform(0.3, 1.5)

    def step(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y, z = p.T
        c, s = np.cos(rate * z), np.sin(rate * z)
        q = np.stack([c * x - s * y, s * x + c * y, z], 1)
        j = np.zeros((len(p), 3, 3))
        j[:, 0, 0], j[:, 0, 1], j[:, 1, 0], j[:, 1, 1], j[:, 2, 2] = c, -s, s, c, 1
        j[:, 0, 2], j[:, 1, 2] = -rate * q[:, 1], rate * q[:, 0]
        return q, j

    return _in_frame(_frame(rng), step)


def _bend(rng: np.random.Generator) -> Map:
    """Draw a bend of the z axis into an arc around a line parallel to y.

    The curvature is bounded by the extent in x, so that the inner side keeps 30 % of its length at
    least, and by an arc of 0.6 turns for the whole length.
    """
    wanted = rng.choice([-1, 1]) * rng.uniform(0.3, 1.9)

    def step(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y, z = p.T
        bound = 0.7 / max(np.abs(x).max(), 1e-3)
        k = np.clip(wanted, -bound, bound)
        c, s = np.cos(k * z), np.sin(k * z)
        q = np.stack([1 / k - (1 / k - x) * c, y, (1 / k - x) * s], 1)
        j = np.zeros((len(p), 3, 3))
        stretch = 1 - k * x  # of lengths along z
        j[:, 0, 0], j[:, 0, 2], j[:, 1, 1] = c, stretch * s, 1
        j[:, 2, 0], j[:, 2, 2] = -s, stretch * c
        return q, j

    return _in_frame(_frame(rng), step)


def _waves(rng: np.random.Generator) -> Map:
    """Draw a displacement by four long plane waves, whose slopes sum to less than 0.7."""
    waves = rng.normal(size=(4, 3))
    waves *= rng.uniform(1.0, 5.0, (4, 1)) / np.linalg.norm(waves, axis=1, keepdims=True)
    moves = rng.normal(size=(4, 3))
    slopes = rng.dirichlet(np.ones(4)) * rng.uniform(0.3, 0.7)
    rates = np.linalg.norm(waves, axis=1) * np.linalg.norm(moves, axis=1)
    moves *= (slopes / rates)[:, None]
    phases = rng.uniform(0, 2 * np.pi, 4)

    def step(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        angles = p @ waves.T + phases
        j = np.einsum("nk,ki,kj->nij", np.cos(angles), moves, waves, optimize=True)
        return p + np.sin(angles) @ moves, j + np.eye(3)

    return step
