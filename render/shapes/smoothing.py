"""Normals for meshes without normals: consistent winding, sharp at creases, smooth elsewhere."""

import numpy as np
import trimesh
from trimesh.graph import connected_component_labels

CREASE = np.radians(50)  # faces that meet at a larger angle keep separate normals
_JOINED = 6  # number of decimals to which vertices in one place agree, in a mesh of about unit size


def face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the normals of the faces, `(F, 3)`; their lengths are twice the faces' areas."""
    a, b, c = vertices[faces].swapaxes(0, 1)
    return np.cross(b - a, c - a)


def smoothed(
    vertices: np.ndarray, faces: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Compute the normals of a mesh from its shape alone.

    Vertices in one place are joined; of several faces with the same corners, the first is kept.
    Faces are turned to agree with their neighbours: all faces of a connected surface get the
    orientation of the majority. A one-sided surface is left as it is. At every vertex, faces that
    are connected by edges flatter than `CREASE` share a normal: the mean of the face normals,
    weighted by area and by angle.

    Args:
        vertices: `(V, 3)`, within about [-1, 1].
        faces: `(F, 3)`; a face of zero area shares no normal with others.

    Returns:
        Vertices, which are doubled along creases; faces; normals of any length; and the number of
        turned faces.
    """
    corners = _joined(vertices)[faces]
    first = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)[1]
    faces, corners = faces[np.sort(first)], corners[np.sort(first)]
    turned = _against(corners)
    faces, corners = (np.where(turned[:, None], f[:, ::-1], f) for f in (faces, corners))
    normals = face_normals(vertices, faces)
    patch = _patches(corners, normals)
    weighted = np.repeat(normals, 3, axis=0) * _angles(vertices[faces]).reshape(-1, 1)
    sums = np.stack([np.bincount(patch, weights=w) for w in weighted.T], axis=1)
    middle = np.empty(len(sums), int)
    middle[patch] = corners.ravel()
    return vertices[middle], patch.reshape(-1, 3), sums, int(turned.sum())


def _joined(vertices: np.ndarray) -> np.ndarray:
    """Return for each vertex the index of the vertex that represents all vertices in its place."""
    rounded = np.round(vertices, _JOINED) + 0.0  # no negative zeros
    _, first, place = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    return first[place.ravel()]


def _edges(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the two half-edges of each edge of exactly two faces, and whether both run alike.

    Each is `(E,)`. Half-edge 3 f + k runs from corner k of face f to the next corner.
    """
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    edges = np.sort(np.stack([start, end], axis=1), axis=1)
    one, other = trimesh.grouping.group_rows(edges, require_count=2).T
    return one, other, start[one] == start[other]


def _against(corners: np.ndarray) -> np.ndarray:
    """Return for each face, `(F,)`, whether it is wound against most of its connected surface."""
    one, other, same = _edges(corners)
    count = len(corners)
    # Each face is two nodes of a graph: as it is, and turned. Neighbours that agree are joined. A
    # surface with two sides gives two components; that with more unturned faces is taken.
    f, g = one // 3, other // 3 + np.where(same, count, 0)
    edges = np.stack([np.r_[f, (f + count)], np.r_[g, (g + count) % (2 * count)]], 1)
    piece = connected_component_labels(edges, 2 * count)
    kept = np.bincount(piece[:count], minlength=piece.max() + 1)
    as_is, turned = piece[:count], piece[count:]
    return (kept[turned] > kept[as_is]) | ((kept[turned] == kept[as_is]) & (turned < as_is))


def _patches(corners: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Number the corners, `(3 F,)`, so that corners that share a normal have the same number."""
    one, other, same = _edges(corners)
    unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    smooth = ~same & ((unit[one // 3] * unit[other // 3]).sum(1) > np.cos(CREASE))
    one, other = one[smooth], other[smooth]
    ends = [h - h % 3 + (h + 1) % 3 for h in (one, other)]
    edges = np.stack([np.r_[one, ends[0]], np.r_[ends[1], other]], 1)
    return connected_component_labels(edges, corners.size)


def _angles(triangles: np.ndarray) -> np.ndarray:
    """Return the angles `(F, 3)` at the corners of triangles `(F, 3, 3)`, in radians."""
    ahead = np.roll(triangles, -1, axis=1) - triangles
    back = np.roll(triangles, 1, axis=1) - triangles
    sine = np.linalg.norm(np.cross(ahead, back), axis=-1)
    return np.arctan2(sine, (ahead * back).sum(-1))
