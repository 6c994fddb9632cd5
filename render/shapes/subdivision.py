"""Division of the long edges of a mesh, without cracks: flat, curved, or with soft edges."""

import numpy as np

from .smoothing import smoothed

_ROUNDS = 6
_MOST_FACES = 20_000
_BULGE = 0.5  # of Phong tessellation: so the middles of a ball's edges come to lie on the ball
_MOST_BULGE = 0.25
"""Largest bulge of an edge, in shortest edges of either end: long splinters of a face stay flat."""

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
    places: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Halve edges until none is longer than `longest`, or until there are many faces.

    Whether and where an edge is divided depends on its two ends alone. So faces that share an
    edge, or whose doubled vertices lie in one place, still meet after it.

    Args:
        vertices: `(V, 3)`.
        faces: `(F, 3)`.
        normals: `(V, 3)`, unit.
        longest: longest edge that stays.
        places: for a curved surface, the number of each vertex's place, `(V,)`: vertices doubled
            at a crease have the same. The middle of an edge between vertices that are alone in
            their places lies on a curve that the planes at both ends touch (Boubekeur and Alexa,
            "Phong tessellation", 2008). By default, all edges are straight.

    Returns:
        Vertices, the given ones first; faces; and unit normals.
    """
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
        middle = (vertices[a] + vertices[b]) / 2
        if places is not None:
            alone = np.bincount(places)[places] == 1
            bulge = _bulges(vertices[b] - vertices[a], normals[a], normals[b])
            shortest = np.full(len(vertices), np.inf)
            np.minimum.at(shortest, ends, np.linalg.norm(spans, axis=-1)[..., None])
            most = np.where(
                alone[a] & alone[b], _MOST_BULGE * np.maximum(shortest[a], shortest[b]), 0
            )
            size = np.linalg.norm(bulge, axis=1)
            middle += bulge * (np.minimum(size, most) / np.maximum(size, 1e-30))[:, None]
            pairs = np.sort(np.stack([places[a], places[b]], 1), axis=1)
            found = np.unique(pairs @ (len(vertices), 1), return_inverse=True)[1]
            places = np.concatenate([places, places.max() + 1 + found])
        between = normals[a] + normals[b]
        size = np.linalg.norm(between, axis=1, keepdims=True)
        between = np.where(size > 1e-3, between / np.maximum(size, 1e-3), normals[a])
        vertices, normals = np.concatenate([vertices, middle]), np.concatenate([normals, between])
        kind = long @ (1, 2, 4)
        faces = np.concatenate(
            [corners[kind == k][:, cut].reshape(-1, 3) for k, cut in enumerate(_CUTS)]
        )
    return vertices, faces, normals


def rounded(
    vertices: np.ndarray, faces: np.ndarray, crease: float, longest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a curved surface through the vertices of a mesh, as if its facets stood for one.

    Args:
        vertices: `(V, 3)`, within about [-1, 1].
        faces: `(F, 3)`.
        crease: angle in radians; faces that meet at a larger one keep a sharp, straight edge.
        longest: longest edge that stays.

    Returns:
        Vertices, faces, and unit normals.
    """
    vertices, faces, normals = _smoothed(vertices, faces, crease)
    places = np.unique(vertices.round(6) + 0.0, axis=0, return_inverse=True)[1]
    return refined(vertices, faces, normals, longest, places.ravel())


def softened(
    vertices: np.ndarray, faces: np.ndarray, crease: float, longest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the same surface with normals that turn smoothly over its edges.

    The edges are divided first, so that a normal turns over no more than `longest`.

    Args:
        vertices: `(V, 3)`, within about [-1, 1].
        faces: `(F, 3)`.
        crease: angle in radians; faces that meet at a larger one keep separate normals.
        longest: longest edge that stays.

    Returns:
        Vertices, faces, and unit normals.
    """
    vertices, faces, _ = refined(vertices, faces, np.zeros_like(vertices), longest)
    return _smoothed(vertices, faces, crease)


def _smoothed(
    vertices: np.ndarray, faces: np.ndarray, crease: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    vertices, faces, normals, _ = smoothed(vertices, faces, crease)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return vertices, faces, np.where(length > 0, normals / np.maximum(length, 1e-300), (0, 1.0, 0))


def _bulges(span: np.ndarray, at_a: np.ndarray, at_b: np.ndarray) -> np.ndarray:
    """Return how far edges' middles are moved, `(E, 3)`, for their spans and the normals at ends.

    The mean of the middle's projections onto the planes at both ends is weighted by `_BULGE`.
    """
    off_a, off_b = ((n * span).sum(1, keepdims=True) * n for n in (at_a, at_b))
    return _BULGE / 4 * (off_b - off_a)
