"""GLB files whose shape needs more than plain triangles: the right shape, or a refusal by name."""

import json
import struct

import numpy as np
import pytest

from lime_keras.render.shapes import gltf, meshes

# A tetrahedron, 2 wide, 1 high and deep.
PLACES = np.array([[0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4")
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], "<u2")
DRACO = "KHR_draco_mesh_compression"
_KINDS = {"<f4": 5126, "<u2": 5123, "<i2": 5122, "|i1": 5120, "|u1": 5121}
_NAMES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


class Glb:
    """A GLB of one mesh of one primitive; `document` may be changed before it is written."""

    def __init__(self, places=PLACES, **accessor):
        self.binary = b""
        self.document = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
        self.document |= {"nodes": [{"mesh": 0}], "bufferViews": [], "accessors": []}
        attributes = {"POSITION": self.add(places, **accessor)}
        self.primitive = {"attributes": attributes, "indices": self.add(FACES.reshape(-1, 1))}
        self.document["meshes"] = [{"primitives": [self.primitive]}]

    def view(self, values):
        self.binary += bytes(-len(self.binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": values.nbytes}
        self.document["bufferViews"].append(view)
        self.binary += values.tobytes()
        return len(self.document["bufferViews"]) - 1

    def add(self, values, **more):
        told = {"bufferView": self.view(values), "componentType": _KINDS[values.dtype.str]}
        told |= {"count": len(values), "type": _NAMES[values.shape[1]]}
        self.document["accessors"].append(told | more)
        return len(self.document["accessors"]) - 1

    def write(self, path, *, requires=()):
        self.document["buffers"] = [{"byteLength": len(self.binary)}]
        self.document["extensionsRequired"] = self.document["extensionsUsed"] = list(requires)
        text = json.dumps(self.document).encode()
        text += b" " * (-len(text) % 4)
        binary = self.binary + bytes(-len(self.binary) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(binary))
        parts = struct.pack("<I4s", len(text), b"JSON") + text
        path.write_bytes(head + parts + struct.pack("<I4s", len(binary), b"BIN\0") + binary)
        return path


def proportions(path):
    """The extents of a mesh by its smallest one, and its number of faces."""
    mesh, _ = meshes.read(path)
    extent = np.ptp(mesh.vertices, axis=0)
    return *(extent / extent.min()).round(3), len(mesh.faces)


def normalised(glb):
    """A second part of bytes, twice as small, beside the first."""
    part = np.round(PLACES / 2 * 127).astype("|i1")
    glb.primitive = {"attributes": {"POSITION": glb.add(part, normalized=True)}, "indices": 1}
    glb.document["meshes"][0]["primitives"].append(glb.primitive)
    glb.document["nodes"] = [{"mesh": 0}]


def sparse(glb):
    indices = {"bufferView": glb.view(np.array([1], "<u2")), "componentType": 5123}
    values = {"bufferView": glb.view(np.array([[6, 0, 0]], "<f4"))}
    glb.document["accessors"][0]["sparse"] = {"count": 1, "indices": indices, "values": values}


def morphed(glb):
    glb.primitive["targets"] = [{"POSITION": glb.add((PLACES * [2, 0, 0]).astype("<f4"))}]
    glb.document["meshes"][0]["weights"] = [0.5]


def morphed_beside_itself(glb):
    """The same mesh twice: the first node has a weight of its own, and the other the mesh's."""
    morphed(glb)
    glb.document["meshes"][0]["weights"] = [0]
    glb.document["nodes"] = [{"mesh": 0, "weights": [1]}, {"mesh": 0, "translation": [6, 0, 0]}]
    glb.document["scenes"] = [{"nodes": [0, 1]}]


def morphed_by_the_second(glb):
    """The first target moves normals alone; a primitive without places shows nothing."""
    morphed(glb)
    glb.primitive["targets"].insert(0, {"NORMAL": 0})
    glb.document["meshes"][0]["weights"] = [9, 0.5]
    glb.document["meshes"][0]["primitives"].append({"attributes": {}})


def instanced(glb):
    moves = glb.add(np.array([[0, 0, 0], [4, 0, 0], [8, 0, 0]], "<f4"))
    told = {gltf._INSTANCES: {"attributes": {"TRANSLATION": moves}}}
    glb.document["nodes"] = [{"mesh": 0, "extensions": told, "scale": [1, 2, 1]}]


def hidden(glb):
    told = {gltf._VISIBILITY: {"visible": False}}
    glb.document["nodes"] = [
        {"mesh": 0, "children": [1]},
        {"children": [2], "extensions": told},
        {"mesh": 0, "scale": [9, 1, 1]},
    ]


def another_scene(glb):
    glb.document["nodes"].append({"mesh": 0, "scale": [3, 1, 1]})
    glb.document |= {"scenes": [{"nodes": [0]}, {"nodes": [1]}], "scene": 1}


def no_scene(glb):
    del glb.document["scenes"], glb.document["scene"]


def fan(glb):
    glb.primitive |= {"mode": 6, "indices": glb.add(np.array([[0], [1], [2], [3]], "<u2"))}


def strip(glb):
    glb.primitive |= {"mode": 5, "indices": glb.add(np.array([[0], [1], [2], [3]], "<u2"))}


@pytest.mark.parametrize(
    ("change", "requires", "expected"),
    [
        (None, (), (2, 1, 1, 4)),
        (None, ("KHR_materials_unlit", "KHR_texture_transform"), (2, 1, 1, 4)),
        (normalised, ("KHR_mesh_quantization",), (2, 1, 1, 8)),
        (sparse, (), (6, 1, 1, 4)),
        (morphed, (), (4, 1, 1, 4)),
        (morphed_beside_itself, (), (8, 1, 1, 8)),
        (morphed_by_the_second, (), (4, 1, 1, 4)),
        (instanced, ("EXT_mesh_gpu_instancing",), (10, 2, 1, 12)),
        (hidden, ("KHR_node_visibility",), (2, 1, 1, 4)),
        (another_scene, (), (6, 1, 1, 4)),
        (no_scene, (), (2, 1, 1, 4)),
        (fan, (), (2, 1, 1, 2)),
        (strip, (), (2, 1, 1, 2)),
    ],
)
def test_the_shape_is_that_of_the_file(change, requires, expected, tmp_path):
    glb = Glb()
    if change:
        change(glb)
    assert proportions(glb.write(tmp_path / "a.glb", requires=requires)) == expected


@pytest.mark.parametrize("name", [DRACO, "EXT_meshopt_compression", "VENDOR_voxels"])
def test_what_a_file_requires_and_is_not_read_is_named(name, tmp_path):
    with pytest.raises(ValueError, match=rf"a\.glb.*requires {name}, .*export it without"):
        meshes.read(Glb().write(tmp_path / "a.glb", requires=[name]))


def test_what_is_used_and_not_applied_is_noted(tmp_path):
    glb = Glb()
    glb.document["nodes"][0]["skin"] = 0
    glb.document["skins"] = [{"joints": [0]}]
    path = glb.write(tmp_path / "a.glb")
    content = path.read_bytes().replace(b'"extensionsUsed": []', b'"extensionsUsed":["V_x"]')
    sizes = len(content) - len(path.read_bytes())
    assert sizes > 0
    *_, notes = gltf.read(_resized(content, sizes))
    assert "skeleton" in notes[0] and "V_x" in notes[1]


def _resized(content, more):
    """A GLB whose document has grown: its two lengths follow."""
    whole, version = len(content), 2
    (size,) = struct.unpack_from("<I", content, 12)
    return struct.pack("<4sIII", b"glTF", version, whole, size + more) + content[16:]


def test_a_fallback_of_compressed_faces_is_read(tmp_path):
    """Draco that a file uses and does not require has plain triangles beside it."""
    glb = Glb()
    glb.primitive["extensions"] = {DRACO: {"bufferView": 0, "attributes": {"POSITION": 0}}}
    assert proportions(glb.write(tmp_path / "a.glb")) == (2, 1, 1, 4)


def test_a_part_in_another_file_is_told(tmp_path):
    glb = Glb()
    path = glb.write(tmp_path / "a.glb")
    content = path.read_bytes().replace(
        b'"buffers": [{"byteLength"', b'"buffers":[{"uri":"b","byteLength"'
    )
    more = len(content) - len(path.read_bytes())
    path.write_bytes(_resized(content, more))
    with pytest.raises(ValueError, match="lies in another file: export it as one GLB"):
        meshes.read(path)


def test_normals_stay_at_right_angles_to_what_is_stretched(tmp_path):
    """A plane that leans by one in one; two times as wide, it leans by one in two."""
    glb = Glb(np.array([[0, 0, 0], [1, 0, -1], [0, 1, 0], [1, 1, -1]], "<f4"))
    normals = np.full((4, 3), np.sqrt(0.5)) * [1, 0, 1]
    glb.primitive["attributes"]["NORMAL"] = glb.add(normals.astype("<f4"))
    faces = np.array([[0, 1, 2], [1, 3, 2]], "<u2")
    glb.primitive["indices"] = glb.add(faces.reshape(-1, 1))
    glb.document["nodes"][0] |= {"scale": [2, 1, 1], "rotation": [0, 1, 0, 0]}
    _, _, found, _ = gltf.read(glb.write(tmp_path / "a.glb").read_bytes())
    found = found[np.isfinite(found).all(1)]
    assert len(found) == 4
    # Half a turn about y has turned them.
    expected = np.array([-1, 0, -2]) / np.sqrt(5)
    np.testing.assert_allclose(
        found / np.linalg.norm(found, axis=1, keepdims=True), expected[None].repeat(4, 0), atol=1e-6
    )


@pytest.mark.parametrize("known", [True, False])
def test_normals_follow_a_morph_target_or_are_made_anew(known, tmp_path):
    """A plate that faces z; its target leans it by one in one."""
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4")
    glb = Glb(flat)
    glb.primitive["indices"] = glb.add(np.array([[0, 1, 2], [1, 3, 2]], "<u2").reshape(-1, 1))
    glb.primitive["attributes"]["NORMAL"] = glb.add(np.full((4, 3), [0, 0, 1], "<f4"))
    target = {"POSITION": glb.add((flat * [0, 0, 1] - flat[:, :1] * [0, 0, 1]).astype("<f4"))}
    if known:
        target["NORMAL"] = glb.add(np.full((4, 3), [0.5, 0, -0.5], "<f4"))
    glb.primitive["targets"] = [target]
    glb.document["meshes"][0]["weights"] = [1.0]
    mesh, _ = meshes.read(glb.write(tmp_path / "a.glb"))
    normals = np.full((4, 3), np.sqrt(0.5)) * [1, 0, 1]
    np.testing.assert_allclose(mesh.normals, normals, atol=1e-6)


def compressed(glb):
    glb.document["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {}}


def nowhere(glb):
    del glb.document["accessors"][0]["bufferView"]


@pytest.mark.parametrize(
    ("change", "told"),
    [(compressed, "are compressed"), (nowhere, "lie nowhere"), (instanced, "shows 3 instances")],
)
def test_shapes_that_cannot_be_read_are_told(change, told, tmp_path, monkeypatch):
    glb = Glb()
    change(glb)
    monkeypatch.setattr(gltf, "_MOST_INSTANCES", 2)
    with pytest.raises(ValueError, match=rf"a\.glb: .*{told}"):
        meshes.read(glb.write(tmp_path / "a.glb"))


def test_a_file_without_a_document_is_told():
    with pytest.raises(ValueError, match="holds no document"):
        gltf.read(gltf._MAGIC + struct.pack("<I", 12))


@pytest.mark.parametrize("damage", ["count", "offset", "view", "loop", "type"])
def test_damaged_documents_are_named(damage, tmp_path):
    glb = Glb()
    sparse(glb)
    accessor = glb.document["accessors"][0]
    if damage == "count":
        accessor["count"] = 2**40
    elif damage == "offset":
        accessor["byteOffset"] = 10**9
    elif damage == "view":
        accessor["bufferView"] = 99
    elif damage == "loop":
        glb.document["nodes"][0]["children"] = [0]
    else:
        accessor["componentType"] = 1
    with pytest.raises(ValueError, match=r"a\.glb: cannot be read as a mesh"):
        meshes.read(glb.write(tmp_path / "a.glb"))


def test_all_solids_of_an_stl_are_read(tmp_path):
    """Two of one name; of such, one alone came."""
    corner = "facet normal 0 0 0\nouter loop\nvertex 0 0 {z}\nvertex 1 0 {z}\nvertex 0 1 {z}\n"
    solid = "solid a\n" + corner + "endloop\nendfacet\nendsolid a\n"
    (tmp_path / "a.stl").write_text(solid.format(z=0) + solid.format(z=2))
    mesh, _ = meshes.read(tmp_path / "a.stl")
    assert len(mesh.faces) == 2 and np.ptp(mesh.vertices[:, 2]) > 1
