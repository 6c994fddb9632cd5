"""Division of long edges: no cracks, no change of flat surfaces, and curves towards a ball."""

import numpy as np
import pytest
import trimesh
from mesh_checks import is_balanced, volume

from lime_keras.render.shapes import subdivision
from lime_keras.render.shapes.meshes import Mesh


def creased_box():
    shape = trimesh.creation.box((1, 1.4, 0.3))
    corners = shape.vertices[shape.faces].reshape(-1, 3)
    return corners, np.arange(36).reshape(-1, 3), np.repeat(shape.face_normals, 3, axis=0)


def edges(vertices, faces):
    return np.linalg.norm(vertices[faces] - vertices[np.roll(faces, -1, axis=1)], axis=-1)


def as_mesh(vertices, faces, normals):
    return Mesh(vertices.astype("f4"), faces, normals)


def test_edges_become_short_and_the_surface_stays():
    given = creased_box()
    vertices, faces, normals = subdivision.refined(*given, 0.2)
    assert edges(vertices, faces).max() <= 0.2
    mesh = as_mesh(vertices, faces, normals)
    assert is_balanced(mesh)
    assert volume(mesh) == pytest.approx(1.4 * 0.3, rel=1e-5)
    np.testing.assert_array_equal(vertices[:36], given[0])
    np.testing.assert_allclose(np.abs(normals).max(1), 1)  # still those of the box


def test_edges_that_are_short_stay():
    given = creased_box()
    vertices, faces, _ = subdivision.refined(*given, 5.0)
    np.testing.assert_array_equal(vertices, given[0])
    np.testing.assert_array_equal(faces, given[1])


def test_each_way_of_cutting_a_face_covers_it_once():
    corners = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    for cut in subdivision._CUTS:
        a, b, c = corners[np.array(cut)].swapaxes(0, 1)
        areas = np.cross(np.c_[b - a, 0 * a[:, 0]], np.c_[c - a, 0 * a[:, 0]])[:, 2] / 2
        assert (areas > 0).all() and areas.sum() == pytest.approx(0.5)


def test_division_ends_when_there_are_many_faces():
    _, faces, _ = subdivision.refined(*creased_box(), 1e-3)
    assert 1000 < len(faces) <= subdivision._MOST_FACES


def test_a_coarse_ball_becomes_rounder():
    coarse = trimesh.creation.icosphere(subdivisions=1)
    vertices, faces, normals = subdivision.rounded(
        coarse.vertices, coarse.faces, np.radians(60), 0.15
    )
    flat, _, _ = subdivision.refined(coarse.vertices, coarse.faces, coarse.vertices, 0.15)
    assert is_balanced(as_mesh(vertices, faces, normals))
    assert len(faces) > 1000
    distance, before = (np.abs(np.linalg.norm(v, axis=1) - 1) for v in (vertices, flat))
    assert distance.mean() < 0.1 * before.mean()
    assert (normals * vertices).sum(1).min() > 0.99


def test_sharp_edges_are_not_rounded():
    shape = trimesh.creation.box((1, 1.4, 0.3))
    vertices, faces, normals = subdivision.rounded(shape.vertices, shape.faces, np.radians(60), 0.2)
    mesh = as_mesh(vertices, faces, normals)
    assert is_balanced(mesh) and volume(mesh) == pytest.approx(1.4 * 0.3, rel=1e-5)
    np.testing.assert_allclose(np.abs(normals).max(1), 1)


@pytest.mark.parametrize("sides", [5, 7, 8])
def test_a_prism_with_a_crease_that_fades_out_has_no_cracks(sides):
    """A cone's edges are sharp at its rim and smooth at its sides: both meet in one face."""
    shape = trimesh.creation.cone(radius=0.6, height=1.0, sections=sides)
    for degrees in (30, 50, 80, 120):
        parts = subdivision.rounded(shape.vertices, shape.faces, np.radians(degrees), 0.1)
        assert is_balanced(as_mesh(*parts))


def test_a_bulge_keeps_to_the_size_of_the_facets():
    """Between normals that lean apart, a long splinter rises by a share of its width alone."""

    def highest(width):
        vertices = np.array([[0, 0, 0], [2, 0, 0], [0, width, 0], [2, width, 0]], float)
        normals = np.array([[-0.6, 0, 0.8], [0.6, 0, 0.8]] * 2)
        faces = np.array([[0, 1, 2], [1, 3, 2]])
        return subdivision.refined(vertices, faces, normals, 1.5, np.arange(4))[0][:, 2].max()

    assert highest(1.0) == pytest.approx(0.5 / 4 * 2 * 2 * 0.6 * 0.8)
    assert highest(0.02) == pytest.approx(0.25 * 0.02, rel=0.01)


def test_soft_edges_turn_the_normals_near_an_edge_alone():
    shape = trimesh.creation.box((1, 1, 1))
    vertices, _, normals = subdivision.softened(shape.vertices, shape.faces, np.radians(100), 0.1)
    np.testing.assert_allclose(np.abs(vertices).max(1), 0.5)
    inner = np.sort(np.abs(vertices), axis=1)[:, 1] < 0.499
    np.testing.assert_allclose(np.abs(normals[inner]).max(1), 1, atol=1e-9)
    assert np.abs(normals[~inner]).max() < 0.9
    sharp = subdivision.softened(shape.vertices, shape.faces, np.radians(80), 0.1)
    np.testing.assert_allclose(np.abs(sharp[2]).max(1), 1, atol=1e-9)
