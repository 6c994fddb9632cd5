"""Triangle meshes: reading them from files, also faulty ones, and normalising them.

Every normalised mesh is centred on its bounding box and scaled so that its farthest vertex lies on
the unit sphere. It is right-handed, Y up; its normals are of length one and point outwards.
"""

import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from lime_keras.io import untrusted

from . import gltf, obj, ply
from .smoothing import face_normals, smoothed

EXTENSIONS = (".obj", ".ply", ".stl", ".glb")

_BETWEEN_SOLIDS = re.compile(rb"^\s*endsolid[^\n]*\n\s*solid[^\n]*\n", re.MULTILINE)
_FACET = re.compile(rb"^\s*facet\s", re.MULTILINE)
_TRUSTED = 0.98
"""Least share of faces with all corner normals on one side, for which a file's normals are used.

Smooth normals of a coarse mesh seldom lie on both sides of a face; garbled normals mostly do.
"""


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh, centred, inside the unit sphere, right-handed, Y up.

    Attributes:
        vertices: `(V, 3)` float32; the farthest vertex is at distance 1 from the origin.
        faces: `(F, 3)` uint32, counter-clockwise seen from outside.
        normals: `(V, 3)` float32, unit, outwards; at creases, vertices are doubled.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray


def check_kind(path: Path) -> None:
    """Raise ValueError if a path has none of the `EXTENSIONS`."""
    if path.suffix.lower() not in EXTENSIONS:
        raise ValueError(
            f"{path}: not a mesh format known here; convert it to one of {', '.join(EXTENSIONS)}."
        )


def load(path: str | Path) -> Mesh:
    """Read a mesh file and normalise the mesh; see `read`, which also returns notes."""
    return read(path)[0]


def read(path: str | Path) -> tuple[Mesh, tuple[str, ...]]:
    """Read a mesh file, repair and normalise the mesh.

    Several parts become one mesh. Faces without area, or with a corner that is missing or not
    finite, are dropped. The file's own normals are used if they are finite and fit the faces; the
    faces are then turned to the side of the normals. Otherwise the faces are turned to agree with
    their neighbours, and normals are made, smooth except across creases of more than 50 degrees.

    Returns:
        The mesh, with the faces of the file, and notes on what was repaired.

    Raises:
        ValueError: If the file is missing, is no mesh file, cannot be read or has no faces.
    """
    path = Path(path)
    check_kind(path)
    untrusted.check(path, "a mesh")
    try:
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is dropped below
            vertices, faces, normals, notes = _parts(path)
    except MemoryError:
        raise  # this machine's fault, not the file's
    except Exception as error:  # trimesh passes on whatever its many readers raise
        reason = str(error) or type(error).__name__
        raise ValueError(f"{path}: cannot be read as a mesh ({reason}); export it anew.") from error
    if len(faces) == 0:
        raise ValueError(
            f"{path}: holds no faces: only points or lines, or it is cut short or no "
            f"{path.suffix[1:].upper()} file; export the surface as triangles."
        )
    count = len(faces)
    vertices, faces = _sound(vertices, faces)
    if len(faces) == 0:
        raise ValueError(
            f"{path}: holds no face of finite, non-zero area; export the surface as triangles."
        )
    if len(faces) < count:
        notes.append(
            f"{count - len(faces)} of {count} faces dropped: no area, or a corner that is missing "
            "or not finite"
        )
    if _trusted(vertices, faces, normals):
        side = _sides(vertices, faces, normals).sum(1) < 0
        turned = int(side.sum())
        faces = np.where(side[:, None], faces[:, ::-1], faces)
    else:
        count = len(faces)
        vertices, faces, normals, turned = smoothed(vertices, faces)
        if len(faces) < count:
            notes.append(
                f"{count - len(faces)} of {count} faces dropped: another has the same corners"
            )
    if 0 < turned < len(faces):
        notes.append(f"{turned} of {len(faces)} faces turned to the side of the others")
    return normalised(vertices, faces, normals), tuple(notes)


def normalised(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> Mesh:
    """Centre and scale a mesh, drop unused vertices, and turn a closed surface right side out."""
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


def may_cover(mesh: Mesh, share: float) -> bool:
    """Return whether a mesh may cover that share of a square picture that its longer side fills.

    The mesh is seen from afar in 64 directions. Hidden faces count too, so the covered share is
    overestimated: only meshes that surely cover too little are found, such as wires or two specks
    far from each other.
    """
    rng = np.random.default_rng(0)
    normals = face_normals(mesh.vertices, mesh.faces)
    for frame in np.linalg.qr(rng.normal(size=(64, 3, 3)))[0].astype(np.float32):
        side = np.ptp(mesh.vertices @ frame[:, :2], axis=0).max()
        if np.abs(normals @ frame[:, 2]).sum(dtype=float) / 2 >= share * side**2:
            return True
    return False


def _parts(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Read vertices, faces and normals of all parts of a file, each part in its place, and notes.

    Normals that the file does not give are NaN. A vertex that is NaN replaces those that a face
    names and the file does not have.
    """
    content, kind = path.read_bytes(), path.suffix.lower()
    if kind == ".glb":
        return gltf.read(content)
    return *{".obj": obj.read, ".ply": ply.read, ".stl": _read_stl}[kind](content), []


def _read_stl(content: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read all solids of an STL, of text or of bytes; its normals, of faces, are not used."""
    expected = 0
    if content.lstrip().startswith(b"solid") and b"facet" in content[:2048]:
        # Of two solids of one name, trimesh reads one.
        content = _BETWEEN_SOLIDS.sub(b"\n", content)
        expected = len(_FACET.findall(content))
    else:
        # Whatever follows the last face lets trimesh take it for text.
        content = content[: 84 + 50 * int.from_bytes(content[80:84], "little")]
    mesh = trimesh.load_mesh(io.BytesIO(content), file_type="stl", process=False)
    if len(mesh.faces) < expected:
        raise ValueError(f"{len(mesh.faces)} faces were read, and it holds {expected}")
    return np.asarray(mesh.vertices), np.asarray(mesh.faces), np.full(mesh.vertices.shape, np.nan)


def _sound(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices scaled into [-1, 1], and the faces of finite area above rounding error."""
    finite = np.isfinite(vertices).all(1)
    faces = faces[finite[faces].all(1)]
    if len(faces) == 0:
        return vertices, faces
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    # Vertices of no face may have any value; moved to a used vertex, they do no harm.
    vertices = np.where(used[:, None], vertices, vertices[faces[0, 0]])
    vertices = vertices / max(np.abs(vertices).max(), np.finfo(float).tiny)
    vertices = vertices - (vertices.min(0) + vertices.max(0)) / 2
    vertices = vertices / max(np.abs(vertices).max(), np.finfo(float).tiny)
    return vertices, faces[np.linalg.norm(face_normals(vertices, faces), axis=1) > 4e-12]


def _sides(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the dot product of each corner's normal with its face's normal, `(F, 3)`."""
    return (normals[faces] * face_normals(vertices, faces)[:, None]).sum(-1)


def _trusted(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> bool:
    """Return whether the normals are finite, not zero, and seldom on both sides of a face."""
    lengths = np.linalg.norm(normals[faces], axis=-1)  # infinite above 1e154
    if not np.isfinite(lengths).all() or (lengths < 1e-6).any():
        return False
    side = _sides(vertices, faces, normals)
    return bool(((side > 0).all(1) | (side < 0).all(1)).mean() >= _TRUSTED)
