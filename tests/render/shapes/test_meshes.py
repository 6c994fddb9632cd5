"""Meshes from files of every format, sound, odd and broken."""

import numpy as np
import pytest
import trimesh
from mesh_checks import check, flat_normals, is_closed, unit, volume

from lime_keras.render.scene import gbuffer, sampling
from lime_keras.render.shapes import meshes


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
    for k, normal in enumerate([(0, 0, 0), ("nan", 0, 1), (0, 1, 0), (0, 0, 1e200)]):
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


def export(vertices, faces, path, normals=None):
    """Written as it is: nothing joined, dropped or made up."""
    mesh = trimesh.Trimesh(vertices, faces, vertex_normals=normals, process=False)
    extra = {"vertex_normal": normals is not None} if path.suffix.lower() == ".ply" else {}
    mesh.export(path, file_type=path.suffix[1:].lower(), **extra)
    return path


@pytest.mark.parametrize("scale", [1e-30, 1e-6, 1.0, 1e6, 1e30, 1e200])
def test_the_unit_of_length_does_not_matter(tmp_path, scale):
    ball = trimesh.creation.icosphere(subdivisions=3)
    lines = ["v {!r} {!r} {!r}".format(*map(float, row)) for row in ball.vertices * scale]
    lines += ["f {} {} {}".format(*row) for row in ball.faces + 1]
    (tmp_path / "ball.obj").write_text("\n".join(lines))
    mesh, notes = meshes.read(tmp_path / "ball.obj")
    check(mesh)
    assert notes == () and len(mesh.vertices) == 642
    assert (mesh.vertices * mesh.normals).sum(1).min() > 0.9999


@pytest.mark.parametrize("extension", meshes.EXTENSIONS)
def test_a_ball_far_away_is_as_round_as_its_file_s_floats(tmp_path, extension):
    ball = trimesh.creation.icosphere(subdivisions=3)
    mesh = meshes.load(export(ball.vertices + 1e5, ball.faces, tmp_path / f"far{extension}"))
    check(mesh)
    assert np.percentile((unit(mesh.vertices) * mesh.normals).sum(1), 5) > 0.99


@pytest.mark.parametrize("name", ["BALL.PLY", "Ball.Obj", "a ball.stl", "Kugel für größere.glb"])
def test_any_name_will_do(tmp_path, name):
    ball = trimesh.creation.icosphere(subdivisions=2)
    assert len(meshes.load(export(ball.vertices, ball.faces, tmp_path / name)).faces) == 320


@pytest.mark.parametrize("kind", ["stl_ascii", "stl"])
def test_stl_is_read_as_text_and_as_bytes_whatever_its_normals(tmp_path, kind):
    ball = trimesh.creation.icosphere(subdivisions=3)
    ball.export(tmp_path / "ball.stl", file_type=kind)
    data = (tmp_path / "ball.stl").read_bytes()
    if kind == "stl":  # some programs begin these, too, as if they were text
        facets = np.frombuffer(data[84:], np.dtype("3<f4, (3,3)<f4, <u2")).copy()
        facets["f0"] = (0, 0, np.nan)
        data = b"solid ball".ljust(80) + data[80:84] + facets.tobytes() + b"more"
    (tmp_path / "ball.stl").write_bytes(data)
    mesh = meshes.load(tmp_path / "ball.stl")
    check(mesh)
    assert len(mesh.vertices) == 642 and (mesh.vertices * mesh.normals).sum(1).min() > 0.999


PLY = """ply
format ascii 1.0
comment by hand
element vertex 5
property float x
property float y
property float z
{properties}
element face {count}
property list uchar int vertex_indices
element edge 1
property int vertex1
property int vertex2
end_header
0 0 0 {values}
1 0 0 {values}
1 1 0 {values}
0 1 0 {values}
0.5 0.5 1 {values}
{faces}0 1
"""
COLOURS = "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float quality"
NORMALS = "property float nx\nproperty float ny\nproperty float nz"
PYRAMID = ["4 3 2 1 0", "3 0 1 4", "3 1 2 4", "3 2 3 4", "3 3 0 4"]


def ply(path, faces=PYRAMID, properties="", values=""):
    rows = "".join(f"{face}\n" for face in faces)
    values = {"count": len(faces), "faces": rows, "properties": properties, "values": values}
    path.write_text(PLY.format(**values).replace("\n\n", "\n"))
    return path


@pytest.mark.parametrize(("properties", "values"), [("", ""), (COLOURS, "9 8 7 0.5")])
def test_ply_with_quads_and_properties_of_its_own(tmp_path, properties, values):
    mesh, notes = meshes.read(ply(tmp_path / "pyramid.ply", PYRAMID, properties, values))
    check(mesh)
    assert is_closed(mesh) and len(mesh.faces) == 6 and notes == ()


def test_normals_of_a_ply_are_kept(tmp_path):
    mesh = meshes.load(ply(tmp_path / "floor.ply", ["4 0 1 2 3"], NORMALS, "0 0.6 0.8"))
    np.testing.assert_allclose(mesh.normals, [[0, 0.6, 0.8]] * 4, atol=1e-6)


@pytest.mark.parametrize("extra", ["3 0 1 77", "3 0 1 -1"])
def test_faces_with_corners_that_are_not_there_are_dropped(tmp_path, extra):
    mesh, notes = meshes.read(ply(tmp_path / "pyramid.ply", [*PYRAMID, extra]))
    assert len(mesh.faces) == 6
    assert notes == ("1 of 7 faces dropped: no area, or a corner that is missing or not finite",)


def test_a_single_triangle_is_a_mesh(tmp_path):
    (tmp_path / "one.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    mesh = meshes.load(tmp_path / "one.obj")
    check(mesh)
    assert mesh.faces.shape == (1, 3) and meshes.may_cover(mesh, 0.4)


def test_every_kind_of_bad_vertex_and_face_is_dropped_and_told(tmp_path):
    (tmp_path / "bad.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv nan 0 0\nv 2 0 0\nv 1e999 0 0\nv 7e7 7e7 7e7\n"
        "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\nf 1 2 5\nf 1 2 6\nf 1 1 2\nf 1 2 7\nf 1 2 99\n"
    )
    mesh, notes = meshes.read(tmp_path / "bad.obj")
    check(mesh)
    assert is_closed(mesh) and len(mesh.faces) == 4
    assert notes[0].startswith("5 of 9 faces dropped")


def test_a_hidden_part_of_no_size_is_dropped(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=2))
    scene.add_geometry(trimesh.creation.icosphere(subdivisions=2), transform=np.diag([0, 0, 0, 1]))
    scene.export(tmp_path / "hidden.glb")
    mesh, notes = meshes.read(tmp_path / "hidden.glb")
    assert len(mesh.faces) == 320 and notes[0].startswith("320 of 640 faces dropped")
    assert (mesh.vertices * mesh.normals).sum(1).min() > 0.999


def test_parts_below_parts_are_placed_by_all_their_nodes(tmp_path):
    scene = trimesh.Scene()
    ball = trimesh.creation.icosphere(subdivisions=2)
    shift = trimesh.transformations.translation_matrix([4, 0, 0])
    scene.graph.update("up", "world", matrix=np.diag([2.0, 2, 2, 1]))
    scene.add_geometry(ball, node_name="near", parent_node_name="up")
    scene.add_geometry(ball, node_name="far", parent_node_name="near", transform=shift)
    scene.export(tmp_path / "tree.glb")
    mesh = meshes.load(tmp_path / "tree.glb")
    check(mesh)
    assert len(mesh.faces) == 640
    np.testing.assert_allclose(mesh.vertices.max(0), [1, 1 / 3, 1 / 3], atol=1e-3)


def test_garbled_normals_of_a_file_are_replaced(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=4)
    rng = np.random.default_rng(0)
    for k, normals in enumerate(
        [
            rng.normal(size=ball.vertices.shape),
            ball.vertices * rng.choice([1, 1, 1, -1], 2562)[:, None],
        ]
    ):
        path = export(ball.vertices, ball.faces, tmp_path / f"ball{k}.ply", unit(normals))
        mesh = meshes.load(path)
        assert (mesh.vertices * mesh.normals).sum(1).min() > 0.9999


# ---- what the renderer sees ------------------------------------------------------------------


def seen(mesh):
    """Coverage `(S, S)` and mean normals `(S, S, 3)` of two views of a mesh."""
    size = 64
    tracer = gbuffer.Tracer(mesh, size)
    views = []
    for seed in (1, 2):
        rotation = sampling.sample_rotation(np.random.default_rng(seed))
        camera = np.array([150.0, 150.0, size / 2, size / 2])
        view = tracer.trace(rotation, np.array([0.0, 0.0, -6.0]), camera)
        sums = [np.bincount(view.pixel, view.normal[:, k], size**2) for k in range(3)]
        mean = np.stack(sums, -1) / np.maximum(np.linalg.norm(sums, axis=0), 1e-9)[:, None]
        views.append((view.coverage, mean.reshape(size, size, 3)))
    return tuple(np.stack(parts) for parts in zip(*views, strict=True))


@pytest.fixture(scope="module")
def ring(mitsuba_choice):
    """A ring, open at one side, so that its inner wall is seen: vertices, faces, normals, image."""
    whole = trimesh.creation.torus(0.7, 0.25, major_sections=96, minor_sections=48)
    vertices, faces = whole.vertices, whole.faces[whole.triangles_center[:, 1] < 0.6]
    normals = unit(vertices - unit(vertices * (1, 1, 0)) * 0.7)
    return vertices, faces, normals, seen(meshes.normalised(vertices, faces, normals))


@pytest.mark.parametrize("normals", ["none", "sound", "flipped", "flipped here and there"])
@pytest.mark.parametrize("share", [0.0, 0.05, 0.3, 1.0])
def test_neither_winding_nor_flipped_normals_change_the_image(tmp_path, ring, share, normals):
    vertices, faces, given, (coverage, expected) = ring
    rng = np.random.default_rng(0)
    faces = np.where(rng.random((len(faces), 1)) < share, faces[:, ::-1], faces)
    given = {
        "none": None,
        "sound": given,
        "flipped": -given,
        "flipped here and there": given * rng.choice([1, 1, -1], len(given))[:, None],
    }[normals]
    mesh = meshes.load(export(vertices, faces, tmp_path / "ring.ply", given))
    found, image = seen(mesh)
    np.testing.assert_allclose(found, coverage, atol=1e-3)
    both = np.minimum(found, coverage) == 1
    angle = np.degrees(np.arccos(np.clip((image * expected).sum(-1)[both], -1, 1)))
    # Along the cut, normals are made of the faces at one side alone.
    assert np.percentile(angle, 98) < 2 and angle.mean() < 0.5


# ---- what is refused -------------------------------------------------------------------------


@pytest.mark.parametrize("extension", [".ply", ".stl", ".glb"])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.95])
def test_files_that_are_cut_short_are_refused_by_name(tmp_path, extension, share):
    ball = trimesh.creation.icosphere(subdivisions=2)
    path = export(ball.vertices, ball.faces, tmp_path / f"cut{extension}")
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(ValueError, match=rf"cut\{extension}: .*(cannot be read|cut short)"):
        meshes.load(path)


def test_a_cloud_of_points_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"cloud\.ply: holds no faces: only points or lines"):
        meshes.load(ply(tmp_path / "cloud.ply", []))


def test_what_is_too_thin_to_be_seen_is_told():
    def stick(width):
        rod = trimesh.creation.box((width, width, 1))
        return meshes.normalised(rod.vertices, rod.faces, rod.vertices)

    assert meshes.may_cover(stick(0.1), 0.02)
    assert not meshes.may_cover(stick(0.001), 0.02)
    ball = trimesh.creation.icosphere(subdivisions=2)
    assert meshes.may_cover(meshes.normalised(ball.vertices, ball.faces, ball.vertices), 0.7)
    there = ball.vertices + np.array([0, 0, 500])
    stray = np.concatenate([ball.vertices, there])
    pair = meshes.normalised(stray, np.concatenate([ball.faces, ball.faces + 162]), stray)
    assert not meshes.may_cover(pair, 0.02)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("shape.step", "", "convert it to one of .obj"),
        ("none.obj", None, "No such file"),
        ("empty.obj", "", "holds no faces"),
        ("comments.obj", "# nothing\n# here\n", "holds no faces"),
        ("points.obj", "v 0 0 0\nv 1 0 0\n", "holds no faces"),
        ("comma.obj", "v 0,5 0 0\n", r"'v 0,5 0 0': could not convert"),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no face of finite, non-zero area"),
        ("broken.ply", "ply\nnothing", "cannot be read as a mesh"),
        ("broken.glb", "nothing", "cannot be read as a mesh"),
        ("broken.stl", "nothing", "holds no faces"),
    ],
)
def test_unfit_files_are_refused_by_name(tmp_path, name, text, message):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=rf"{name}:? .*{message}"):
        meshes.load(tmp_path / name)
