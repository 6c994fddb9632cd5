"""Triangle meshes: normalised, and read from files of every quality.

Every mesh is normalised alike: centred on its bounding box, scaled so that the farthest vertex lies
on the unit sphere, right-handed, Y up, normals of length one pointing outwards.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

EXTENSIONS = (".obj", ".ply", ".stl", ".glb")

CREASE = np.radians(50)  # faces that meet at a larger angle keep separate normals


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh, centred, inside the unit sphere, right-handed, Y up.

    Attributes:
        vertices: `(V, 3)` float32, the farthest at distance 1 from the origin.
        faces: `(F, 3)` uint32, counter-clockwise seen from outside.
        normals: `(V, 3)` float32, of unit length, outwards; creased edges have doubled vertices.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray


def load(path: str | Path) -> Mesh:
    """Reads a mesh file and normalises it.

    Several parts become one mesh, non-finite vertices and degenerate faces are dropped. The file's
    own normals are used if they are finite and agree with the winding; otherwise normals are smooth
    except across creases of more than 50 degrees.

    Args:
        path: A file with one of the `EXTENSIONS`.

    Returns:
        The mesh, as large as the file says.

    Raises:
        ValueError: If the file is missing, of another kind, cannot be read or has no faces.
    """
    path = Path(path)
    if path.suffix.lower() not in EXTENSIONS:
        raise ValueError(
            f"{path}: not a mesh format known here; convert it to one of {', '.join(EXTENSIONS)}."
        )
    if not path.is_file():
        raise ValueError(f"{path}: no such file; check the path.")
    try:
        with path.open("rb") as file:
            scene = trimesh.load_scene(file, file_type=path.suffix[1:].lower(), process=False)
        vertices, faces, normals = _assembled(scene)
    except Exception as error:  # trimesh passes on whatever its many readers raise
        raise ValueError(f"{path}: cannot be read as a mesh ({error}); export it anew.") from error
    faces = _sound_faces(vertices, faces)
    if len(faces) == 0:
        raise ValueError(
            f"{path}: holds no face of finite, non-zero area; export the surface as triangles."
        )
    if _agree(vertices, faces, normals):
        return normalised(vertices, faces, normals)
    return normalised(*_creased(vertices, faces))


def normalised(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> Mesh:
    """Centres, scales, drops unused vertices, and turns a closed surface outside out."""
    used, faces = np.unique(faces, return_inverse=True)
    vertices, normals = np.asarray(vertices, float)[used], np.asarray(normals, float)[used]
    faces = faces.reshape(-1, 3)
    vertices = vertices - (vertices.min(0) + vertices.max(0)) / 2
    vertices /= np.linalg.norm(vertices, axis=1).max()
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 0, normals / np.maximum(lengths, 1e-30), (0.0, 1.0, 0.0))
    a, b, c = vertices[faces].swapaxes(0, 1)
    if (np.cross(a, b) * c).sum() < 0:  # six times the enclosed volume
        faces = faces[:, ::-1]
        normals = -normals
    return Mesh(vertices.astype("f4"), np.ascontiguousarray(faces, "u4"), normals.astype("f4"))


def _assembled(scene: trimesh.Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All parts in their places; normals that the file does not give are NaN."""
    vertices, faces, normals, count = [np.zeros((0, 3))], [np.zeros((0, 3), int)], [], 0
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        part = scene.geometry[name]
        if not len(getattr(part, "faces", ())):
            continue  # points and lines
        linear = matrix[:3, :3]
        vertices.append(part.vertices @ linear.T + matrix[:3, 3])
        turned = -1 if np.linalg.det(linear) < 0 else 1  # a mirror image turns the winding
        faces.append(count + part.faces[:, ::turned])
        # trimesh makes normals up when asked for them; only the cache tells which were read.
        given = "vertex_normals" in part._cache.cache
        blank = np.full(part.vertices.shape, np.nan)
        normals.append(part.vertex_normals @ np.linalg.inv(linear) if given else blank)
        count += len(part.vertices)
    return tuple(np.concatenate(p) for p in (vertices, faces, [np.zeros((0, 3)), *normals]))


def _sound_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The faces of finite corners and of an area that is not rounding error."""
    finite = np.isfinite(vertices).all(1)
    faces = faces[finite[faces].all(1)]
    if len(faces) == 0:
        return faces
    extent = np.ptp(vertices[faces].reshape(-1, 3), axis=0).max()
    return faces[np.linalg.norm(_face_normals(vertices, faces), axis=1) > 1e-12 * extent**2]


def _face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Normals as long as twice the faces' areas."""
    a, b, c = vertices[faces].swapaxes(0, 1)
    return np.cross(b - a, c - a)


def _agree(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> bool:
    """Whether given normals are finite, not zero, and on the winding's side for nine in ten."""
    given = normals[faces]
    if not np.isfinite(given).all() or (np.linalg.norm(given, axis=-1) < 1e-6).any():
        return False
    side = (given * _face_normals(vertices, faces)[:, None]).sum(-1)
    return bool((side > 0).mean() > 0.9)


def _creased(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joins equal positions, then smooths within patches bounded by creases."""
    corners = vertices[faces].reshape(-1, 3)
    positions, same = np.unique(corners, axis=0, return_inverse=True)
    joined = trimesh.Trimesh(positions, same.reshape(-1, 3), process=False)
    smooth = trimesh.graph.smooth_shade(joined, angle=CREASE)
    return smooth.vertices, smooth.faces, smooth.vertex_normals
