"""Reading of Wavefront OBJ files: polygons as triangles, with the normals that the file gives."""

import codecs
from array import array

import numpy as np
from manifold3d import triangulate


def read(data: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read all polygons of a file, of every object, group and material, as triangles.

    Polygons need not be convex. As in the format's definition, indices below zero count back from
    the vertex read last.

    Returns:
        Vertices `(V, 3)`, triangles `(F, 3)`, and normals `(V, 3)`, NaN where the file gives none.
        Vertex 0 is NaN: it replaces vertices that a polygon names and the file does not have.

    Raises:
        ValueError: If a line cannot be read.
    """
    vertices, normals = [(np.nan,) * 3], [(np.nan,) * 3]
    polygons: dict[int, array] = {}  # by number of corners: vertex and normal of each corner
    data = data.removeprefix(codecs.BOM_UTF8)  # some editors write it
    data = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    for line in data.splitlines():
        words = line.partition(b"#")[0].split()
        kind = words[0] if words else b""
        try:
            if kind == b"f":
                known = len(vertices), len(normals)
                polygon = [index for word in words[1:] for index in _corner(word, *known)]
                polygons.setdefault(len(words) - 1, array("q")).extend(polygon)
            elif kind in (b"v", b"vn"):
                x, y, z = map(float, words[1:4])
                (vertices if kind == b"v" else normals).append((x, y, z))
        except ValueError as error:
            raise ValueError(f"{line[:60].decode(errors='replace')!r}: {error}") from error
    places, known = np.array(vertices), (len(vertices), len(normals))
    cut = [np.zeros((0, 3, 2), int)]
    for size, indices in polygons.items():
        if size >= 3:
            outlines = np.array(indices).reshape(-1, size, 2)
            outlines = np.where(outlines < known, outlines, 0)  # 0 for indices beyond the end
            cut.append(triangles(outlines, places))
    corners = np.concatenate(cut)
    pairs, faces = np.unique(corners[..., 0] * len(normals) + corners[..., 1], return_inverse=True)
    nowhere = np.full((1, 3), np.nan)
    vertex, normal = np.divmod(pairs, len(normals))
    return (
        np.concatenate([nowhere, places[vertex]]),
        faces.reshape(-1, 3) + 1,
        np.concatenate([nowhere, np.array(normals)[normal]]),
    )


def _corner(word: bytes, vertices: int, normals: int) -> tuple[int, int]:
    """Return the indices of a corner's vertex and normal, 0 for none.

    In the file it is `v`, `v/vt`, `v//vn` or `v/vt/vn`; so many vertices and normals were read.
    """
    vertex, _, rest = word.partition(b"/")
    one, other = int(vertex), int(rest.rpartition(b"/")[2] or 0) if b"/" in rest else 0
    return (
        one if one >= 0 else max(vertices + one, 0),
        other if other >= 0 else max(normals + other, 0),
    )


def triangles(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Cut polygons `(P, n, C)` into triangles `(F, 3, C)`: fans, or ears if a fan folds over.

    Args:
        corners: numbers of each corner, its vertex's first.
        places: vertices `(V, 3)`.
    """
    points = places[corners[..., 0]]
    spokes = points[:, 1:] - points[:, :1]
    normals = np.cross(spokes[:, :-1], spokes[:, 1:])  # normals of a fan's triangles
    folded = ((normals * normals.sum(1, keepdims=True)).sum(-1) < 0).any(1)
    fan = [[0, k, k + 1] for k in range(1, corners.shape[1] - 1)]
    cut = [
        polygon[_ears(outline, normal)]
        for polygon, outline, normal in zip(
            corners[folded], points[folded], normals[folded].sum(1), strict=True
        )
    ]
    return np.concatenate([corners[~folded][:, fan].reshape(-1, 3, corners.shape[-1]), *cut])


def _ears(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Cut a polygon `(n, 3)` into triangles `(n - 2, 3)` of its corners' numbers."""
    axis = int(np.argmax(np.abs(normal)))
    flat = points[:, [(axis + 1) % 3, (axis + 2) % 3]]
    flat = flat if normal[axis] > 0 else flat[:, ::-1]  # counter-clockwise
    return np.asarray(triangulate([np.ascontiguousarray(flat)]))
