"""Division of the long edges of a mesh, without cracks, on flat faces or on a curved surface."""

import numpy as np

from .smoothing import smoothed

_ROUNDS = 6
_MOST_FACES = 20_000
_BULGE = 0.75  # of Phong tessellation; the authors' choice

_CUTS = [
    [[0, 1, 2]],  # none of the edges
    [[0, 3, 2], [3, 1, 2]],
    [[0, 1, 4], [0, 4, 2]],
    [[0, 3, 2], [3, 4, 2], [3, 1, 4]],
    [[0, 1, 5], [5, 1, 2]],
    [[0, 3, 5], [3, 1, 5], [5, 1, 2]],
    [[0, 1, 5], [5, 1, 4], [5, 4, 2]],
    [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
]
"""The triangles of a face with corners 0, 1, 2, in which edge 0 is divided at 3 if bit 0 of the row
is set, edge 1 at 4 for bit 1, and edge 2 at 5 for bit 2. Edge k runs from corner k."""


def refined(
    vertices: np.ndarray,
    faces: np.ndarray,
    normals: np.ndarray,
    longest: float,
    curved: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Halve edges until none is longer than `longest`, or until there are many faces.

    Whether and where an edge is divided depends on its two ends alone. So faces that share an
    edge, or whose doubled vertices lie in one place, still meet after it.

    Args:
        vertices: `(V, 3)`.
        faces: `(F, 3)`.
        normals: `(V, 3)`, unit.
        longest: longest edge that stays.
        curved: whether each vertex, `(V,)`, has one normal alone in its place. The middle of an
            edge between two of them lies on a curve that the planes at both ends touch (Boubekeur
            and Alexa, "Phong tessellation", 2008). By default, all edges are straight.

    Returns:
        Vertices, the given ones first; faces; and unit normals.
    """
    if curved is None:
        curved = np.zeros(len(vertices), bool)
    faces = faces.astype(int)
    for _ in range(_ROUNDS):
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], -1)
        spans = vertices[ends[..., 0]] - vertices[ends[..., 1]]
        long = (spans * spans).sum(-1) > longest**2
        if not long.any() or len(faces) + 2 * long.sum() > _MOST_FACES:
            break
        pairs = np.sort(ends[long], axis=1)
        keys, place = np.unique(pairs[:, 0] * len(vertices) + pairs[:, 1], return_inverse=True)
        a, b = np.divmod(keys, len(vertices))
        corners = np.concatenate([faces, np.zeros_like(faces)], axis=1)
        corners[:, 3:][long] = len(vertices) + place
        bent = curved[a] & curved[b]
        middle, normal = _middles(vertices[a], vertices[b], normals[a], normals[b], bent)
        vertices, normals = np.concatenate([vertices, middle]), np.concatenate([normals, normal])
        curved = np.concatenate([curved, curved[a] | curved[b]])
        kind = long @ (1, 2, 4)
        faces = np.concatenate(
            [corners[kind == k][:, cut].reshape(-1, 3) for k, cut in enumerate(_CUTS)]
        )
    return vertices, faces, normals


def rounded(
    vertices: np.ndarray, faces: np.ndarray, crease: float, longest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a smooth surface through the vertices of a mesh, which keeps the sharpest edges.

    Args:
        vertices: `(V, 3)`, within about [-1, 1].
        faces: `(F, 3)`.
        crease: angle in radians; faces that meet at a larger one keep a sharp, straight edge.
        longest: longest edge that stays.

    Returns:
        Vertices, faces, and unit normals.
    """
    vertices, faces, normals, _ = smoothed(vertices, faces, crease)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 1e-12, normals / np.maximum(length, 1e-12), (0.0, 1.0, 0.0))
    _, place, count = np.unique(
        vertices.round(6) + 0.0, axis=0, return_inverse=True, return_counts=True
    )
    return refined(vertices, faces, normals, longest, count[place.ravel()] == 1)


def _middles(
    a: np.ndarray, b: np.ndarray, at_a: np.ndarray, at_b: np.ndarray, bent: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the middles of edges between points `a` and `b`, `(E, 3)`, and the normals there."""
    span = b - a
    off_a, off_b = ((n * span).sum(1, keepdims=True) * n for n in (at_a, at_b))
    middle = (a + b) / 2 - np.where(bent[:, None], _BULGE / 4, 0.0) * (off_a - off_b)
    between = at_a + at_b
    length = np.linalg.norm(between, axis=1, keepdims=True)
    return middle, np.where(length > 1e-3, between / np.maximum(length, 1e-3), at_a)
