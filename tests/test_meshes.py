"""Meshes from files of every format, sound, odd and broken."""

import numpy as np
import pytest
import trimesh
from mesh_checks import check, flat_normals, is_closed, volume

from lime_keras.render import meshes


@pytest.mark.parametrize("extension", meshes.EXTENSIONS)
def test_a_ball_of_odd_size_and_place_is_read(tmp_path, extension):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=250)
    ball.apply_translation([1000, -40, 7])
    ball.export(tmp_path / f"ball{extension}")
    mesh = meshes.load(tmp_path / f"ball{extension}")
    check(mesh)
    assert len(mesh.faces) == 1280
    assert (mesh.vertices * mesh.normals).sum(1).min() > 0.99


@pytest.mark.parametrize("extension", meshes.EXTENSIONS)
def test_a_box_gets_creases(tmp_path, extension):
    box = trimesh.creation.box((1, 2, 3))
    box = trimesh.Trimesh(box.vertices, box.faces, process=False)
    box.export(tmp_path / f"box{extension}")
    mesh = meshes.load(tmp_path / f"box{extension}")
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
    mesh = meshes.load(tmp_path / "two.glb")
    check(mesh)
    assert len(mesh.faces) == 640
    np.testing.assert_allclose(mesh.vertices.max(0), [1, 1 / 3, 1 / 3], atol=1e-3)


def test_a_mirrored_part_still_faces_outwards(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=2))
    mirror = np.diag([-0.5, 0.5, 0.5, 1.0])
    mirror[0, 3] = 4
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=2), transform=mirror)
    scene.export(tmp_path / "mirrored.glb")
    mesh = meshes.load(tmp_path / "mirrored.glb")
    middles = mesh.vertices[mesh.faces].mean(1)
    right = middles[:, :1] > 0.3
    centres = np.where(right, (1 - 0.5 / 2.75, 0, 0), (1 / 2.75 - 1, 0, 0))
    assert 0 < right.sum() < len(right)
    assert ((flat_normals(mesh) * (middles - centres)).sum(1) > 0).all()


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
        mesh = meshes.load(path)
        check(mesh)
        assert ((flat_normals(mesh)[:, None] * mesh.normals[mesh.faces]).sum(-1) > 0).all()


def test_sane_normals_of_a_file_are_kept(tmp_path):
    path = tmp_path / "triangle.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0.6 0.8\nf 1//1 2//1 3//1\n")
    np.testing.assert_allclose(meshes.load(path).normals, [[0, 0.6, 0.8]] * 3, atol=1e-6)


def test_a_closed_mesh_inside_out_is_turned(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2)
    trimesh.Trimesh(ball.vertices, ball.faces[:, ::-1], process=False).export(tmp_path / "in.stl")
    mesh = meshes.load(tmp_path / "in.stl")
    assert volume(mesh) > 0 and (mesh.vertices * mesh.normals).sum(1).min() > 0.9


def test_broken_faces_are_dropped(tmp_path):
    path = tmp_path / "broken.obj"
    path.write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv nan 0 0\nv 2 0 0\n"
        "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\nf 1 2 5\nf 1 2 6\nf 1 1 2\n"
    )
    mesh = meshes.load(path)
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
        meshes.load(tmp_path / name)
