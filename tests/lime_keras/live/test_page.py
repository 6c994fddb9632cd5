"""The page's own arithmetic, run by Node, held against the Python that it repeats."""

import json

import javascript
import numpy as np
import pytest

from lime_keras.estimate import interchange
from lime_keras.material import Material
from lime_keras.optics import colour, environment, shading, studio_light

SIZE = 40
SHAPE = environment.STORED_SHAPE


def _one_texel(row, column):
    light = np.zeros(SHAPE)
    light[row, column] = 1000.0
    return light


def _room(seed):
    rng = np.random.default_rng(seed)
    return environment.blur(rng.lognormal(0, 2, SHAPE), 0.1) + 5 * (rng.uniform(size=SHAPE) > 0.998)


LIGHTS = {
    "studio": studio_light.light(),
    "room": _room(0),
    "one lamp at the side": _one_texel(31, 31),
}
"""Extreme lights are among the stability cases."""
EXPONENTS = (1.0, 7.0, 32.0, 33.0, 1000.0)

TABLES = """
const { diffuse, specular, tableNormals } = await import(page + "shading.js");
const light = { width, height, data };
const tables = { normals: tableNormals(size), diffuse: diffuse(light, size) };
for (const s of exponents) tables[s] = specular(light, s, size);
return tables;
"""


@pytest.mark.parametrize("name", LIGHTS)
def test_the_tables_are_the_sums_of_the_library(name):
    light = LIGHTS[name].astype(np.float32)
    height, width = SHAPE
    shape = {"width": width, "height": height, "size": SIZE}
    found = javascript.run(TABLES, data=light, **shape, exponents=EXPONENTS)
    normal = np.reshape(found.pop("normals"), (-1, 3))
    assert np.linalg.norm(normal, axis=-1) == pytest.approx(1, abs=1e-6)
    # Some of the normals that a viewer sees.
    seen = np.flatnonzero(normal[:, 2] > 0)[::3]
    found = {name: table[seen] for name, table in found.items()}
    n, o = normal[seen], np.broadcast_to((0.0, 0.0, 1.0), (len(seen), 3))
    texels, energy = shading.texels(light.astype(np.float64))
    expected = shading.diffuse(n, texels, energy)
    assert_near(found["diffuse"], expected, 0.002)
    for exponent in EXPONENTS:
        expected = shading.specular(n, o, exponent, texels, energy)
        # Wide lobes are summed over four texels as one, which shows where a lamp sets.
        assert_near(found[str(int(exponent))], expected, 0.03 if exponent <= 32 else 0.002)


def assert_near(found, expected, share):
    """Within a share of the largest value, everywhere."""
    assert np.abs(found - expected).max() <= share * expected.max()


def test_the_studio_is_that_of_the_library():
    code = """
    const { studio } = await import(page + "panorama.js");
    const { width, height, data } = studio();
    return { width, height, data: [...data] };
    """
    found = javascript.run(code)
    assert np.reshape(found["data"], SHAPE) == pytest.approx(studio_light.light())
    assert (found["height"], found["width"]) == SHAPE


def test_linear_levels_are_those_of_the_library():
    code = """
    const { LINEAR } = await import(page + "colour.js");
    return [...LINEAR];
    """
    linear = javascript.run(code)
    assert linear == pytest.approx(colour.srgb_to_linear(np.arange(256) / 255), rel=1e-5)


def test_gltf_has_the_numbers_of_the_library():
    rng = np.random.default_rng(0)
    drawn = [*rng.uniform(size=(60, 5)), np.zeros(5), np.ones(5)]
    materials = [
        {"diffuse_albedo": list(m[:3]), "specular_albedo": m[3], "exponent": 1000 ** m[4]}
        for m in drawn
    ]
    code = """
    const { gltfMaterial } = await import(page + "exports.js");
    return materials.map(gltfMaterial);
    """
    for numbers, found in zip(materials, javascript.run(code, materials=materials), strict=True):
        diffuse = np.array(numbers["diffuse_albedo"])
        material = Material(**numbers | {"diffuse_albedo": diffuse})
        (expected,) = json.loads(interchange.gltf(material, "lime"))["materials"]
        assert plain(found) == pytest.approx(plain(expected), rel=1e-5, abs=1e-9)


def plain(value):
    """The numbers in nested lists and objects, in order of their names."""
    if isinstance(value, dict):
        return [number for _, inside in sorted(value.items()) for number in plain(inside)]
    if isinstance(value, list):
        return [number for inside in value for number in plain(inside)]
    return [] if isinstance(value, str) else [value]


def test_a_gltf_file_holds_its_sphere():
    code = """
    const { gltf } = await import(page + "exports.js");
    const material = { diffuse_albedo: [0.5, 0.4, 0.3], specular_albedo: 0.2, exponent: 50 };
    return JSON.parse(gltf(material, "1.2"));
    """
    found = javascript.run(code)
    (buffer,) = found["buffers"]
    last = found["bufferViews"][-1]
    assert last["byteOffset"] + last["byteLength"] == buffer["byteLength"]
    assert found["asset"] == {"version": "2.0", "generator": "lime_keras 1.2"}
    assert found["accessors"][0]["count"] < 2**16


SHAPES = """
const shapes = await import(page + "shapes.js");
return names.map((name) => {
  const { positions, normals, indices } = shapes[name]();
  return { positions: [...positions], normals: [...normals], indices: [...indices] };
});
"""


def test_the_shapes_are_closed_smooth_and_turned_outside():
    names = ["sphere", "knot", "teapot"]
    for name, mesh in zip(names, javascript.run(SHAPES, names=names), strict=True):
        points, normals = (np.reshape(mesh[key], (-1, 3)) for key in ("positions", "normals"))
        triangles = np.reshape(mesh["indices"], (-1, 3))
        assert np.linalg.norm(normals, axis=-1) == pytest.approx(1, abs=1e-5), name
        assert np.linalg.norm(points, axis=-1).max() == pytest.approx(1, abs=1e-5), name
        corners = points[triangles]
        volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
        assert volume > 0.5, name
        if name == "sphere":
            assert volume == pytest.approx(4 / 3 * np.pi, rel=0.01)
            assert normals == pytest.approx(points, abs=2e-3)


MESH = """
const { parse } = await import(page + "meshes.js");
try {
  const { positions, normals, indices } = parse(bytes.buffer, "mine.ply");
  return { positions: [...positions], normals: [...normals], indices: [...indices] };
} catch (error) {
  return { name: error.name, error: error.message };
}
"""


def parse(content):
    return javascript.run(MESH, bytes=np.frombuffer(content, np.uint8))


@pytest.mark.parametrize(
    ("kind", "mirrored"), [("ply", 1), ("ply-ascii", 1), ("glb", 1), ("glb", -1)]
)
def test_a_users_mesh_is_read_and_fitted(kind, mirrored):
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.box(extents=(2, 4, 6), transform=np.diag([1.0, 1, 1, 1]))
    mesh.apply_translation((10, 20, 30))
    if kind == "glb":
        scene = trimesh.Scene()
        # The scene turns it by a quarter about the vertical, and may mirror it.
        turn = trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0))
        turn = turn @ np.diag([mirrored, 1, 1, 1])
        scene.add_geometry(mesh, transform=turn)
        content = scene.export(file_type="glb")
    else:
        content = mesh.export(file_type="ply", encoding="ascii" if "ascii" in kind else "binary")
    found = parse(content)
    points = np.reshape(found["positions"], (-1, 3))
    sides = np.array([6, 4, 2] if kind == "glb" else [2, 4, 6]) / np.sqrt(56)
    assert np.abs(points).max(0) == pytest.approx(sides, abs=1e-5)
    assert len(found["indices"]) == 36 and max(found["indices"]) < len(points)
    normals = np.reshape(found["normals"], (-1, 3))
    assert np.linalg.norm(normals, axis=-1) == pytest.approx(1, abs=1e-5)
    assert np.all(np.sum(normals * points, axis=-1) > 0)


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_a_mesh_whose_header_has_an_umlaut_is_read(encoding):
    trimesh = pytest.importorskip("trimesh")
    content = trimesh.creation.box().export(file_type="ply", encoding=encoding)
    noted = content.replace(b"1.0\n", "1.0\ncomment made by Müller\n".encode(), 1)
    assert noted != content and parse(noted) == parse(content)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "neither GLB nor PLY"),
        (b"solid cube", "neither GLB nor PLY"),
        (b"ply\nformat ascii 1.0\n", "header does not end"),
        (b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nend_header\n1 2", "damaged"),
        (b"glTF\x02\0\0\0\xff\0\0\0\xf0\0\0\0JSON{", "damaged"),
        (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
            b"property float z\nend_header\n0 0 0\n",
            "no triangles",
        ),
        (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
            b"property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
            b"end_header\n0 0 0\n3 0 1 2\n",
            "damaged",
        ),
        (
            b"ply\nformat ascii 1.0\nelement vertex 9999999999\nproperty float x\nend_header\n",
            "more",
        ),
    ],
)
def test_what_is_no_mesh_is_told(content, told):
    answer = parse(content)
    assert answer["name"] == "EngineError"
    assert told in answer["error"] and "mine.ply" in answer["error"]


def test_the_outline_of_a_disc_is_a_circle():
    code = """
    const { segments } = await import(page + "view.js");
    return segments(mask, size);
    """
    size = 64
    y, x = np.mgrid[:size, :size] + 0.5
    distance = np.hypot(x - 30, y - 33)
    mask = np.rint(255 * np.clip(20.5 - distance, 0, 1)).astype(np.uint8)
    found = np.array(javascript.run(code, mask=mask, size=size))
    radius = np.hypot(found[..., 0] - 30, found[..., 1] - 33)
    assert radius == pytest.approx(20, abs=0.15)
    length = np.linalg.norm(found[:, 0] - found[:, 1], axis=-1).sum()
    assert length == pytest.approx(2 * np.pi * 20, rel=0.01)
    # All of it, and a mask that fills its square is closed around.
    full = np.array(javascript.run(code, mask=np.full(16, 255, np.uint8), size=4))
    assert full.min() == 0 and full.max() == 4


BESIDE = """
const { placeBeside } = await import(page + "view.js");
return boxes.map(([[left, top, right, bottom], before]) => {
  const place = placeBeside({ left, top, right, bottom }, 640, 480, before);
  return [place.left, place.top, place.side, place.onRight];
});
"""


def test_the_second_object_has_its_place_beside_the_first():
    """Or in its place, in a frame of 640 × 480; each box with the side it was on before."""
    places = {
        # As large as the object, where there is more room; halfway up its height.
        ((40, 100, 240, 260), True): (240, 80, 200, True),
        ((400, 100, 600, 260), True): (200, 80, 200, False),
        # Hardly larger than the room, and no taller than the picture.
        ((0, 0, 320, 360), True): (320, 20, 320, True),
        ((0, 0, 100, 480), False): (100, 0, 480, True),
        # It stays on its side as long as the other has hardly more room.
        ((200, 100, 420, 260), False): (0, 80, 200, False),
        ((200, 100, 420, 260), True): (420, 70, 220, True),
        # An object that leaves no room is replaced, and one beyond the picture as well.
        ((20, 0, 630, 480), True): (85, 0, 480, False),
        ((0, 0, 400, 480), True): (0, 0, 480, True),
        ((-100, 400, 700, 600), False): (60, 0, 480, True),
        # A small object's second is not as small.
        ((300, 200, 320, 220), True): (320, 114, 192, True),
    }
    found = javascript.run(BESIDE, boxes=list(places))
    assert found == [pytest.approx(place) for place in places.values()]


RESTARTS = """
const { createEngine } = await import(page + "server_engine.js");
const asked = [];
globalThis.fetch = async (path, { body }) => {
  const length = new DataView(await body.slice(0, 4).arrayBuffer()).getUint32(0, true);
  const { number, restart } = JSON.parse(await body.slice(4, 4 + length).text());
  asked.push(restart);
  if (number === 1) engine.restart();
  if (number === 2) throw new TypeError("nobody answers");
  const told = new TextEncoder().encode(JSON.stringify({ number, arrays: {} }));
  const content = new Uint8Array(4 + told.length);
  new DataView(content.buffer).setUint32(0, told.length, true);
  content.set(told, 4);
  return { ok: true, arrayBuffer: async () => content.buffer };
};
const engine = await createEngine({ about: "" });
const image = { width: 1, height: 1, data: new Uint8Array(4) };
for (const number of [0, 1, 2, 3, 4]) {
  await engine.estimate({ number, image, mask: null, options: {} }).catch(() => {});
}
return asked;
"""


def test_a_restart_is_not_lost_while_a_frame_is_on_its_way():
    """Nor with the frame that nobody answers: the next one asks for it again."""
    assert javascript.run(RESTARTS) == [True, False, True, True, False]
