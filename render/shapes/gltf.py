"""Reading of GLB files: the triangles that a file shows, each in its place.

What changes the shape is applied (normalised and sparse positions, morph targets, instances, strips
and fans, hidden nodes), said (skeletons), or refused by its name (compression, and whatever else a
file requires that is not known here).
"""

import base64
import json
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from trimesh import transformations
from trimesh.util import triangle_strips_to_faces

from . import parts
from .parts import Part

_MAGIC, _JSON, _BINARY = b"glTF\2\0\0\0", b"JSON", b"BIN\0"  # the version follows the name
_INSTANCES, _VISIBILITY = "EXT_mesh_gpu_instancing", "KHR_node_visibility"
_KNOWN = (
    *(_INSTANCES, _VISIBILITY, "KHR_mesh_quantization"),
    *("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_"),
    *("EXT_lights_", "KHR_xmp", "KHR_animation_pointer"),
)
"""Beginnings of the names of extensions that are applied, or that leave the shape as it is."""
_COMPRESSED = ("KHR_draco_mesh_", "EXT_meshopt_", "KHR_meshopt_")
_TYPES = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_LARGEST = 2**28
"""Largest number of values of an accessor, a guard against counts that no file holds."""
_MOST_INSTANCES = 10_000


def read(content: bytes) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Read the triangles of a file's default scene.

    Returns:
        Vertices, triangles and normals, as `obj.read` returns them, and notes on what the file uses
        that is not applied.

    Raises:
        ValueError: if it is no GLB, or requires what is not read.
    """
    document, binary = _chunks(content)
    required, notes = document.get("extensionsRequired", []), []
    for name in required:
        if not name.startswith(_KNOWN):
            raise ValueError(
                f"it requires {name}, which is not read here: open it in Blender, say, and export "
                "it without"
            )
    if any("skin" in node for node in document.get("nodes", [])):
        notes.append("posed by a skeleton, which is not applied: export the pose as a mesh")
    for name in sorted(set(document.get("extensionsUsed", [])) - set(required)):
        if not name.startswith(_KNOWN + _COMPRESSED):
            notes.append(f"uses {name}, which is not applied")
    nowhere = np.full((1, 3), np.nan)
    nothing = nowhere, np.zeros((0, 3), int), nowhere
    vertices, faces, normals = parts.joined([nothing, *_File(document, binary).shown()])
    return vertices, faces, normals, notes


def _chunks(content: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the document and the binary part of a GLB."""
    if content[:8] != _MAGIC:
        raise ValueError("it is no GLB by its content")
    chunks: dict[bytes, bytes] = {}
    place = 12
    while place + 8 <= len(content):
        size, kind = struct.unpack_from("<I4s", content, place)
        chunks.setdefault(kind, content[place + 8 : place + 8 + size])
        place += 8 + size
    if place > len(content):
        raise ValueError("it is cut short")
    document = json.loads(chunks.get(_JSON, b"null"))
    if not isinstance(document, dict):
        raise ValueError("it holds no document")
    return document, chunks.get(_BINARY, b"")


class _File:
    """The parts of a GLB."""

    def __init__(self, document: dict[str, Any], binary: bytes):
        buffers = document.get("buffers", [])
        if not all(buffer.get("uri", "data:").startswith("data:") for buffer in buffers):
            raise ValueError("a part of it lies in another file: export it as one GLB")
        self.document = document
        self.buffers = [
            base64.b64decode(buffer["uri"].partition(",")[2]) if "uri" in buffer else binary
            for buffer in buffers
        ]

    def shown(self) -> Iterator[Part]:
        """Yield the parts of the default scene, each as often and where it is shown."""
        nodes = self.document.get("nodes", [])
        below = {child for node in nodes for child in node.get("children", [])}
        roots = [number for number in range(len(nodes)) if number not in below]
        if scenes := self.document.get("scenes"):
            roots = scenes[self.document.get("scene", 0)].get("nodes", [])
        met = set(roots)
        left = [(nodes[number], np.eye(4)) for number in roots]
        while left:
            node, above = left.pop()
            extensions = node.get("extensions", {})
            if extensions.get(_VISIBILITY, {}).get("visible") is False:
                continue  # and so is all below it
            matrix = above @ _placement(node)
            children = node.get("children", [])
            if not met.isdisjoint(children):
                raise ValueError("its nodes lead to themselves")
            met.update(children)
            left += [(nodes[child], matrix) for child in children]
            if _INSTANCES in extensions:
                left += [(place, matrix) for place in self._instances(node)]
            elif "mesh" in node:
                yield from self._mesh(node, matrix)

    def _instances(self, node: dict[str, Any]) -> list[dict[str, Any]]:
        """Return a node for each instance of a node's mesh."""
        attributes = node["extensions"][_INSTANCES].get("attributes", {})
        names = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}
        values = {
            own: self._values(attributes[name]) for name, own in names.items() if name in attributes
        }
        count = max(map(len, values.values()), default=0)
        if "mesh" not in node:
            return []
        if count > _MOST_INSTANCES:
            raise ValueError(f"it shows {count} instances, more than the {_MOST_INSTANCES} taken")
        mesh = {key: node[key] for key in ("mesh", "weights") if key in node}
        return [
            mesh | {own: value[number] for own, value in values.items()} for number in range(count)
        ]

    def _mesh(self, node: dict[str, Any], matrix: np.ndarray) -> Iterator[Part]:
        """Yield the parts of a node's mesh; vertex 0 of each replaces those that are not there."""
        mesh, linear = self.document["meshes"][node["mesh"]], matrix[:3, :3]
        weights = node.get("weights") or mesh.get("weights", [])
        for primitive in mesh["primitives"]:
            attributes, mode = primitive["attributes"], primitive.get("mode", _TRIANGLES)
            if "POSITION" not in attributes or mode not in (_TRIANGLES, _STRIP, _FAN):
                continue  # points and lines
            places = self._places(primitive, weights)
            faces = self._faces(primitive, mode, len(places))
            if np.linalg.det(linear) < 0:  # a mirror image turns the winding
                faces = faces[:, ::-1]
            faces = np.where((faces >= 0) & (faces < len(places)), faces + 1, 0)
            normals = np.full(places.shape, np.nan)
            moved = [to for _, to in _moves(primitive, weights) if "POSITION" in to]
            known = "NORMAL" in attributes and all("NORMAL" in to for to in moved)
            if known and np.linalg.matrix_rank(linear) == 3:
                normals = self._moved("NORMAL", primitive, weights) @ np.linalg.inv(linear)
            nowhere = np.full((1, 3), np.nan)
            yield (
                np.concatenate([nowhere, places @ linear.T + matrix[:3, 3]]),
                faces,
                np.concatenate([nowhere, normals]),
            )

    def _places(self, primitive: dict[str, Any], weights: list[float]) -> np.ndarray:
        """Return the vertices of a primitive `(V, 3)`, moved to its morph targets."""
        accessor = self.document["accessors"][primitive["attributes"]["POSITION"]]
        moved = any("POSITION" in to for _, to in _moves(primitive, weights))
        if not moved and {"bufferView", "sparse"}.isdisjoint(accessor):
            raise ValueError("its vertices lie nowhere: it was compressed, say")
        return self._moved("POSITION", primitive, weights).astype(np.float32)

    def _moved(self, name: str, primitive: dict[str, Any], weights: list[float]) -> np.ndarray:
        """Return an attribute of a primitive, `(V, 3)`, moved to its morph targets."""
        values = self._values(primitive["attributes"][name])
        for weight, to in _moves(primitive, weights):
            if name in to:
                values = values + weight * self._values(to[name])
        return values

    def _faces(self, primitive: dict[str, Any], mode: int, count: int) -> np.ndarray:
        """Return the triangles `(F, 3)` of a primitive of `count` vertices."""
        corners = np.arange(count)
        if "indices" in primitive:
            corners = self._values(primitive["indices"])[:, 0].astype(int)
        if mode == _STRIP:
            return triangle_strips_to_faces([corners])
        if mode == _FAN:
            first = np.repeat(corners[:1], max(len(corners) - 2, 0))
            return np.stack([first, corners[1:-1], corners[2:]], -1)
        return corners.reshape(-1, 3)

    def _values(self, number: int) -> np.ndarray:
        """Return the values `(N, C)` of an accessor, as floats, its sparse ones in their places."""
        accessor = self.document["accessors"][number]
        count, columns = accessor["count"], _COLUMNS[accessor["type"]]
        kind = np.dtype(f"<{_TYPES[accessor['componentType']]}")
        if not 0 <= count * columns <= _LARGEST:
            raise ValueError(f"it announces {count} values")
        out = np.zeros((count, columns), kind)
        if "bufferView" in accessor:
            out = self._stored(accessor, count, columns, kind).copy()
        if sparse := accessor.get("sparse"):
            few, indices = sparse["count"], sparse["indices"]
            kind_of_indices = np.dtype(f"<{_TYPES[indices['componentType']]}")
            out[self._stored(indices, few, 1, kind_of_indices)[:, 0]] = self._stored(
                sparse["values"], few, columns, kind
            )
        if not accessor.get("normalized") or kind.kind == "f":
            return out.astype(float)
        return np.maximum(out / np.iinfo(kind).max, -1)

    def _stored(
        self, place: dict[str, Any], count: int, columns: int, kind: np.dtype
    ) -> np.ndarray:
        """Return what a view of a buffer holds, `(count, columns)`."""
        view = self.document["bufferViews"][place["bufferView"]]
        if any(name.startswith(_COMPRESSED) for name in view.get("extensions", {})):
            raise ValueError("its vertices are compressed: export it anew")
        start = view.get("byteOffset", 0)
        return np.ndarray(
            (count, columns),
            kind,
            self.buffers[view.get("buffer", 0)][start : start + view["byteLength"]],
            place.get("byteOffset", 0),
            (view.get("byteStride") or columns * kind.itemsize, kind.itemsize),
        )


def _moves(primitive: dict[str, Any], weights: list[float]) -> list[tuple[float, dict[str, int]]]:
    """Return the morph targets of a primitive that move it, with their weights."""
    pairs = zip(weights, primitive.get("targets", []), strict=False)
    return [(weight, target) for weight, target in pairs if weight]


def _placement(node: dict[str, Any]) -> np.ndarray:
    """Return the matrix `(4, 4)` that places a node's content in the node above."""
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    matrix = np.reshape(node.get("matrix", np.eye(4)), (4, 4)).T
    matrix = matrix @ transformations.translation_matrix(node.get("translation", (0, 0, 0)))
    matrix = matrix @ transformations.quaternion_matrix((w, x, y, z))
    return matrix @ np.diag([*node.get("scale", (1, 1, 1)), 1])
