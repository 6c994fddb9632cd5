"""Division of the long edges of a mesh, without cracks."""

import numpy as np

_ROUNDS = 6
_MOST_FACES = 40_000

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
    vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray, longest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Halve edges until none is longer than `longest`, or until there are many faces.

    Whether and where an edge is divided depends on its two ends alone. So faces that share an
    edge, or whose doubled vertices lie in one place, still meet after it.

    Args:
        vertices: `(V, 3)`.
        faces: `(F, 3)`.
        normals: `(V, 3)`, unit; those of new vertices are between those of the edge's ends.
        longest: the longest edge that stays.

    Returns:
        Vertices and normals in float64, the given ones first; and faces.
    """
    vertices, normals, faces = vertices.astype(float), normals.astype(float), faces.astype(int)
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
        vertices = np.concatenate([vertices, (vertices[a] + vertices[b]) / 2])
        between = normals[a] + normals[b]
        length = np.linalg.norm(between, axis=1, keepdims=True)
        between = np.where(length > 1e-3, between / np.maximum(length, 1e-3), normals[a])
        normals = np.concatenate([normals, between])
        kind = long @ (1, 2, 4)
        faces = np.concatenate(
            [corners[kind == k][:, cut].reshape(-1, 3) for k, cut in enumerate(_CUTS)]
        )
    return vertices, faces, normals
