"""GLB files as their format means them: what trimesh passes over is put into plain triangles first.

What changes the shape is applied (normalised and sparse positions, morph targets, instances, fans,
hidden nodes), said (skeletons), or refused by its name (compression, and whatever else a file
requires that is not known here).
"""

import copy
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"
_INSTANCES, _DRACO = "EXT_mesh_gpu_instancing", "KHR_draco_mesh_compression"
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_VISIBILITY = "KHR_node_visibility"
_APPLIED = (_INSTANCES, _VISIBILITY, "KHR_mesh_quantization")
_OF_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp")
"""Beginnings of the names of extensions that leave the shape as it is."""
_NO_SHAPE = (
    "KHR_animation_pointer",
    "EXT_lights_image_based",
    "EXT_lights_ies",
    "MSFT_texture_dds",
)
_TYPES = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_LARGEST = 2**28
"""Largest number of values of an accessor, a guard against counts that no file holds."""
_MOST_INSTANCES = 10_000


@dataclass(frozen=True)
class Plain:
    """A GLB of plain triangles.

    Attributes:
        content: the file's bytes.
        faces: number of triangles that it holds, in all places where it shows them.
        notes: what it uses that is not applied.
    """

    content: bytes
    faces: int
    notes: tuple[str, ...]


def plain(content: bytes) -> Plain:
    """Return a GLB whose shape needs nothing but triangles.

    Raises:
        ValueError: if it is no GLB, or requires what is not read.
    """
    document, binary = _chunks(content)
    _check_required(document)
    if any(
        not buffer.get("uri", "data:").startswith("data:") for buffer in document.get("buffers", [])
    ):
        raise ValueError("a part of it lies in another file: export it as one GLB")
    notes = []
    if any("skin" in node for node in document.get("nodes", [])):
        notes.append("posed by a skeleton, which is not applied: export the pose as a mesh")
    used = set(document.get("extensionsUsed", [])) - set(document.get("extensionsRequired", []))
    for name in sorted(used):
        if not _is_known(name) and name not in (*_MESHOPT, _DRACO):
            notes.append(f"uses {name}, which is not applied")
    file = _File(document, bytearray(binary))
    file.make_plain()
    faces = sum(file.faces(mesh) for mesh in file.shown())
    return Plain(_joined(document, bytes(file.binary)), faces, tuple(notes))


def _chunks(content: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the document and the binary part of a GLB."""
    if content[:4] != _MAGIC:
        raise ValueError("it is no GLB by its content")
    parts: dict[bytes, bytes] = {}
    place = 12
    while place + 8 <= len(content):
        size, kind = struct.unpack_from("<I4s", content, place)
        parts.setdefault(kind, content[place + 8 : place + 8 + size])
        place += 8 + size
    document = json.loads(parts.get(_JSON, b"null"))
    if not isinstance(document, dict):
        raise ValueError("it holds no document")
    return document, parts.get(_BINARY, b"")


def _joined(document: dict[str, Any], binary: bytes) -> bytes:
    binary += bytes(-len(binary) % 4)
    if document.get("buffers"):
        document["buffers"][0]["byteLength"] = len(binary)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<I4s", len(text), _JSON) + text
    parts += struct.pack("<I4s", len(binary), _BINARY) + binary
    return _MAGIC + struct.pack("<II", 2, 12 + len(parts)) + parts


def _is_known(name: str) -> bool:
    return name.startswith(_OF_LOOKS) or name in (*_APPLIED, *_NO_SHAPE)


def _check_required(document: dict[str, Any]) -> None:
    for name in document.get("extensionsRequired", []):
        if name == _DRACO or name in _MESHOPT:
            raise ValueError(
                f"it requires {name}: open it in Blender, say, and export it without compression"
            )
        if not _is_known(name):
            raise ValueError(f"it requires {name}, which is not read here")


class _File:
    """The parts of a GLB, which are changed in place."""

    def __init__(self, document: dict[str, Any], binary: bytearray):
        self.document, self.binary = document, binary
        for name in ("nodes", "meshes", "accessors", "bufferViews"):
            document.setdefault(name, [])
        nodes = document["nodes"]
        if not document.get("scenes"):
            below = {child for node in nodes for child in node.get("children", [])}
            document["scenes"] = [{"nodes": [k for k in range(len(nodes)) if k not in below]}]
            document["scene"] = 0

    def make_plain(self) -> None:
        """Apply what changes the shape."""
        meshes = self.document["meshes"]
        for node in self.document["nodes"]:
            if "mesh" in node and node.get("weights"):  # these hold for it alone
                meshes.append(copy.deepcopy(meshes[node["mesh"]]) | {"weights": node["weights"]})
                node["mesh"] = len(meshes) - 1
        for mesh in meshes:
            mesh["primitives"] = [p for p in mesh["primitives"] if "POSITION" in p["attributes"]]
            for primitive in mesh["primitives"]:
                primitive.get("extensions", {}).pop(_DRACO, None)  # what is there is a fallback
                if primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _STRIP, _FAN):
                    self._make_plain(primitive, mesh.get("weights", []))
        for node in list(self.document["nodes"]):
            if _INSTANCES in node.get("extensions", {}):
                self._show_instances(node)
        for node in self._hidden():
            node.pop("mesh", None)

    def shown(self) -> Iterator[dict[str, Any]]:
        """Yield the meshes of the default scene, each as often as it is shown."""
        nodes, meshes = self.document["nodes"], self.document["meshes"]
        left = list(self.document["scenes"][self.document.get("scene", 0)].get("nodes", []))
        for _ in range(100 * len(nodes) + 1):
            if not left:
                return
            node = nodes[left.pop()]
            left += node.get("children", [])
            if "mesh" in node:
                yield meshes[node["mesh"]]
        raise ValueError("its nodes lead to themselves")

    def faces(self, mesh: dict[str, Any]) -> int:
        """Return the number of triangles of a mesh."""
        count = 0
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            place = primitive.get("indices", primitive["attributes"]["POSITION"])
            if mode not in (_TRIANGLES, _STRIP):
                continue
            corners = self.document["accessors"][place]["count"]
            count += corners // 3 if mode == _TRIANGLES else max(corners - 2, 0)
        return count

    def _make_plain(self, primitive: dict[str, Any], weights: list[float]) -> None:
        """Give a primitive positions that are plain floats, and triangles in place of a fan."""
        accessors, attributes = self.document["accessors"], primitive["attributes"]
        accessor = accessors[attributes["POSITION"]]
        pairs = zip(weights, primitive.get("targets", []), strict=False)
        moves = [(weight, to["POSITION"]) for weight, to in pairs if weight and "POSITION" in to]
        if moves or accessor.get("normalized") or "sparse" in accessor:
            places = self._values(accessor)
            for weight, target in moves:
                places = places + weight * self._values(accessors[target])
            attributes["POSITION"] = self._add(places.astype("<f4"), "VEC3", 5126)
        elif "bufferView" not in accessor:
            raise ValueError("its vertices lie nowhere: it was compressed, say")
        if "sparse" in accessors[primitive.get("indices", 0)] and "indices" in primitive:
            raise ValueError("its faces are sparse: export it anew")
        if primitive.get("mode", _TRIANGLES) == _FAN:
            count = accessors[attributes["POSITION"]]["count"]
            corners = np.arange(count)
            if "indices" in primitive:
                corners = self._values(accessors[primitive["indices"]])[:, 0].astype(int)
            first = np.full(max(len(corners) - 2, 0), corners[0] if len(corners) else 0)
            faces = np.stack([first, corners[1:-1], corners[2:]], -1)
            primitive["indices"] = self._add(faces.astype("<u4").reshape(-1, 1), "SCALAR", 5125)
            primitive["mode"] = _TRIANGLES

    def _show_instances(self, node: dict[str, Any]) -> None:
        """Give a node a child for each of its instances."""
        told = node["extensions"].pop(_INSTANCES).get("attributes", {})
        names = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}
        values = {
            own: self._values(self.document["accessors"][told[name]])
            for name, own in names.items()
            if name in told
        }
        mesh, count = node.pop("mesh", None), max((len(v) for v in values.values()), default=0)
        if mesh is None or not count:
            return
        if count > _MOST_INSTANCES:
            raise ValueError(f"it shows {count} instances, more than the {_MOST_INSTANCES} taken")
        for number in range(count):
            place = {own: list(map(float, value[number])) for own, value in values.items()}
            node.setdefault("children", []).append(len(self.document["nodes"]))
            self.document["nodes"].append({"mesh": mesh} | place)

    def _hidden(self) -> Iterator[dict[str, Any]]:
        """Yield the nodes that are not visible, and all below them."""
        nodes = self.document["nodes"]
        left = [
            k
            for k, node in enumerate(nodes)
            if node.get("extensions", {}).get(_VISIBILITY, {}).get("visible") is False
        ]
        visited = set()
        while left:
            number = left.pop()
            if number not in visited:
                visited.add(number)
                left += nodes[number].get("children", [])
                yield nodes[number]

    def _values(self, accessor: dict[str, Any]) -> np.ndarray:
        """Return the values `(N, C)` of an accessor, as floats, its sparse ones in their places."""
        count, columns = accessor["count"], _COLUMNS[accessor["type"]]
        kind = np.dtype(f"<{_TYPES[accessor['componentType']]}")
        if not 0 <= count * columns <= _LARGEST:
            raise ValueError(f"it announces {count} values")
        out = np.zeros((count, columns), kind)
        if "bufferView" in accessor:
            out = self._stored(accessor, count, columns, kind).copy()
        if sparse := accessor.get("sparse"):
            few, told = sparse["count"], sparse["indices"]
            kind_of_indices = np.dtype(f"<{_TYPES[told['componentType']]}")
            out[self._stored(told, few, 1, kind_of_indices)[:, 0]] = self._stored(
                sparse["values"], few, columns, kind
            )
        if not accessor.get("normalized") or kind.kind == "f":
            return out.astype(float)
        return np.maximum(out / np.iinfo(kind).max, -1)

    def _stored(
        self, place: dict[str, Any], count: int, columns: int, kind: np.dtype
    ) -> np.ndarray:
        """Return what a view of the buffer holds, `(count, columns)`."""
        view = self.document["bufferViews"][place["bufferView"]]
        if view.get("buffer", 0) != 0 or {*_MESHOPT} & view.get("extensions", {}).keys():
            raise ValueError("its vertices lie in another file, or are compressed: export it anew")
        row = columns * kind.itemsize
        start = view.get("byteOffset", 0) + place.get("byteOffset", 0)
        return np.ndarray(
            (count, columns),
            kind,
            bytes(self.binary),
            start,
            (view.get("byteStride") or row, kind.itemsize),
        )

    def _add(self, values: np.ndarray, kind: str, component: int) -> int:
        """Append values to the buffer, and return the number of their accessor."""
        self.binary += bytes(-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": values.nbytes}
        self.binary += values.tobytes()
        self.document["bufferViews"].append(view)
        accessor = {
            "bufferView": len(self.document["bufferViews"]) - 1,
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        self.document["accessors"].append(accessor)
        return len(self.document["accessors"]) - 1
