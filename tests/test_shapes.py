"""Shapes: closed, outwards, unit-sized, varied; files of every format, and broken ones."""

import numpy as np
import pytest
import trimesh
from lime_keras.render import shapes

SEEDS = range(60)


def faces_by_position(mesh):
    """Faces over positions, so that vertices doubled along creases count as one."""
    _, position = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return position.reshape(-1)[mesh.faces.astype(int)]


def is_closed(mesh):
    """Whether every edge is run through as often one way as the other, and once."""
    faces = faces_by_position(mesh)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there = {(a, b) for a, b in edges.tolist()}
    return len(there) == len(edges) and all((b, a) in there for a, b in there)


def flat_normals(mesh):
    a, b, c = mesh.vertices[mesh.faces.astype(int)].astype(float).swapaxes(0, 1)
    return np.cross(b - a, c - a)


def volume(mesh):
    a, b, c = mesh.vertices[mesh.faces.astype(int)].astype(float).swapaxes(0, 1)
    return (np.cross(a, b) * c).sum() / 6


def check(mesh):
    assert mesh.vertices.dtype == np.float32 and mesh.vertices.shape[1:] == (3,)
    assert mesh.faces.dtype == np.uint32 and mesh.normals.shape == mesh.vertices.shape
    assert mesh.faces.max() < len(mesh.vertices)
    assert np.isfinite(mesh.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1).max(), 1, atol=1e-5)
    np.testing.assert_allclose(mesh.vertices.min(0), -mesh.vertices.max(0), atol=1e-5)


@pytest.mark.parametrize("seed", SEEDS)
def test_procedural_shapes_are_closed_and_face_outwards(seed):
    mesh = shapes.procedural(np.random.default_rng(seed))
    check(mesh)
    assert 5_000 <= len(mesh.faces) <= 40_000
    assert is_closed(mesh)
    assert volume(mesh) > 1e-3
    flat = flat_normals(mesh)
    side = (flat[:, None] * mesh.normals[mesh.faces]).sum(-1)
    assert (side > 0).mean() > 0.98


@pytest.mark.parametrize("seed", SEEDS)
def test_procedural_shapes_are_one_piece(seed):
    mesh = shapes.procedural(np.random.default_rng(seed))
    faces = faces_by_position(mesh)
    joined = trimesh.Trimesh(np.zeros((faces.max() + 1, 3)), faces, process=False)
    labels = trimesh.graph.connected_component_labels(joined.edges, node_count=faces.max() + 1)
    assert labels.max() == 0


def test_shapes_are_a_function_of_the_generator():
    first, again, other = (shapes.procedural(np.random.default_rng(k)) for k in (0, 0, 1))
    np.testing.assert_array_equal(first.vertices, again.vertices)
    np.testing.assert_array_equal(first.faces, again.faces)
    assert first.vertices.shape != other.vertices.shape


def test_shapes_vary_from_round_to_thin_and_from_smooth_to_creased():
    meshes = [shapes.procedural(np.random.default_rng(seed)) for seed in SEEDS]
    volumes = np.array([volume(mesh) for mesh in meshes]) / (4 / 3 * np.pi)
    assert volumes.min() < 0.1 and volumes.max() > 0.5
    creased = [len(np.unique(m.vertices, axis=0)) < len(m.vertices) for m in meshes]
    assert 0.1 < np.mean(creased) < 0.6


def test_a_ball_has_the_normals_of_a_ball():
    mesh = shapes._polygonise(lambda p: np.sqrt((p**2).sum(0)) - np.float32(0.7), 1.0)
    assert (mesh.vertices * mesh.normals).sum(1).min() > 0.999


def test_a_box_keeps_flat_sides():
    extent = np.array([[0.3], [0.4], [0.5]], np.float32)
    mesh = shapes._polygonise(lambda p: shapes._box(p, extent, 0.02), 1.0)
    assert (np.abs(mesh.normals).max(1) > 0.999).mean() > 0.85


def test_a_turned_cone_has_a_crease_and_the_slope_of_a_cone():
    class Plain:  # no flutes, no twist
        def integers(self, *_):
            return 3

        def uniform(self, *_):
            return 0.0

        def choice(self, *_, **__):
            return 0.0

    profile = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    mesh = shapes._turned(profile, Plain())
    assert is_closed(mesh)
    slope = np.array([2, 1]) / np.sqrt(5)
    side = mesh.normals[:, 1] > -0.5
    np.testing.assert_allclose(mesh.normals[side, 1], slope[1], atol=1e-5)
    np.testing.assert_allclose(mesh.normals[~side, 1], -1, atol=1e-5)


# ---- files -----------------------------------------------------------------------------------


@pytest.mark.parametrize("extension", shapes.EXTENSIONS)
def test_a_ball_of_odd_size_and_place_is_read(tmp_path, extension):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=250)
    ball.apply_translation([1000, -40, 7])
    ball.export(tmp_path / f"ball{extension}")
    mesh = shapes.load(tmp_path / f"ball{extension}")
    check(mesh)
    assert len(mesh.faces) == 1280
    assert (mesh.vertices * mesh.normals).sum(1).min() > 0.99


@pytest.mark.parametrize("extension", shapes.EXTENSIONS)
def test_a_box_gets_creases(tmp_path, extension):
    box = trimesh.creation.box((1, 2, 3))
    box = trimesh.Trimesh(box.vertices, box.faces, process=False)
    box.export(tmp_path / f"box{extension}")
    mesh = shapes.load(tmp_path / f"box{extension}")
    check(mesh)
    assert is_closed(mesh)
    np.testing.assert_allclose(np.abs(mesh.normals).max(1), 1, atol=1e-5)


def test_several_parts_become_one_mesh(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=2))
    scene.add_geometry(
        trimesh.creation.icosphere(subdivisions=2),
        transform=trimesh.transformations.translation_matrix([4, 0, 0]),
    )
    scene.export(tmp_path / "two.glb")
    mesh = shapes.load(tmp_path / "two.glb")
    check(mesh)
    assert len(mesh.faces) == 640
    np.testing.assert_allclose(mesh.vertices.max(0), [1, 1 / 3, 1 / 3], atol=1e-3)


OBJ = """
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
vn {0} {1} {2}
f 1//1 3//1 2//1
f 1//1 2//1 4//1
f 1//1 4//1 3//1
f 2//1 3//1 4//1
"""


def test_insane_normals_of_a_file_are_replaced(tmp_path):
    for k, normal in enumerate([(0, 0, 0), ("nan", 0, 1), (0, 1, 0)]):
        path = tmp_path / f"tetrahedron{k}.obj"
        path.write_text(OBJ.format(*normal))
        mesh = shapes.load(path)
        check(mesh)
        assert ((flat_normals(mesh)[:, None] * mesh.normals[mesh.faces]).sum(-1) > 0).all()


def test_sane_normals_of_a_file_are_kept(tmp_path):
    path = tmp_path / "triangle.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0.6 0.8\nf 1//1 2//1 3//1\n")
    np.testing.assert_allclose(shapes.load(path).normals, [[0, 0.6, 0.8]] * 3, atol=1e-6)


def test_a_closed_mesh_inside_out_is_turned(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2)
    trimesh.Trimesh(ball.vertices, ball.faces[:, ::-1], process=False).export(tmp_path / "in.stl")
    mesh = shapes.load(tmp_path / "in.stl")
    assert volume(mesh) > 0 and (mesh.vertices * mesh.normals).sum(1).min() > 0.9


def test_broken_faces_are_dropped(tmp_path):
    path = tmp_path / "broken.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv nan 0 0\nv 2 0 0\n"
        "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\nf 1 2 5\nf 1 2 6\nf 1 1 2\n"
    )
    mesh = shapes.load(path)
    check(mesh)
    assert len(mesh.faces) == 4


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("shape.step", "", "convert it to one of .obj"),
        ("none.obj", None, "no such file"),
        ("empty.obj", "", ""),
        ("points.obj", "v 0 0 0\nv 1 0 0\n", ""),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no face of finite, non-zero area"),
        ("broken.ply", "ply\nnothing", "cannot be read as a mesh"),
        ("broken.glb", "nothing", "cannot be read as a mesh"),
        ("broken.stl", "nothing", ""),
    ],
)
def test_unfit_files_are_refused_by_name(tmp_path, name, text, message):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=rf"{name}: .*{message}"):
        shapes.load(tmp_path / name)
