"""Normals made from shape alone: against closed forms, however the faces are wound."""

import numpy as np
import pytest
import trimesh
from mesh_checks import unit

from lime_keras.render.shapes import smoothing


def turned(faces, share, seed=0):
    chosen = np.random.default_rng(seed).random(len(faces)) < share
    return np.where(chosen[:, None], faces[:, ::-1], faces)


def consistent(vertices, faces):
    """Whether every edge of a closed mesh is run through once each way."""
    position = np.unique(np.round(vertices, 6), axis=0, return_inverse=True)[1].reshape(-1)
    edges = np.concatenate([position[faces][:, [k, (k + 1) % 3]] for k in range(3)])
    there = {tuple(edge) for edge in edges.tolist()}
    return len(there) == len(edges) and all((b, a) in there for a, b in there)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.45, 0.7, 1.0])
@pytest.mark.parametrize("soup", [False, True])
def test_a_ball_with_faces_turned_at_random_is_a_ball(share, soup):
    ball = trimesh.creation.icosphere(subdivisions=4)
    vertices, faces = ball.vertices, turned(ball.faces, share)
    if soup:
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
        vertices = vertices + np.random.default_rng(1).normal(0, 1e-12, vertices.shape)
    vertices, faces, normals, count = smoothing.smoothed(vertices, faces)
    assert len(vertices) == len(ball.vertices) and consistent(vertices, faces)
    cosine = (unit(normals) * vertices).sum(1) * (1 if share < 0.5 else -1)
    assert np.degrees(np.arccos(cosine.min())) < 0.5
    assert count == pytest.approx(min(share, 1 - share) * len(ball.faces), rel=0.1)


def test_every_surface_is_turned_by_itself():
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices = np.concatenate([ball.vertices * 0.3 - 0.5, ball.vertices * 0.3 + 0.5])
    faces = np.concatenate([turned(ball.faces, 0.2), turned(ball.faces, 0.2, 1) + 162])
    vertices, faces, normals, _ = smoothing.smoothed(vertices, faces)
    centre = np.where(vertices[:, :1] < 0, -0.5, 0.5)
    assert (unit(normals) * unit(vertices - centre)).sum(1).min() > 0.99


def test_a_cylinder_is_smooth_around_and_flat_at_its_ends():
    tube = trimesh.creation.cylinder(radius=0.4, height=1.2, sections=48)
    vertices, _, normals, _ = smoothing.smoothed(tube.vertices, turned(tube.faces, 0.2))
    normals = unit(normals)
    cap = np.abs(normals[:, 2]) > 0.5
    np.testing.assert_allclose(np.abs(normals[cap, 2]), 1, atol=1e-6)
    around = unit(vertices[~cap] * (1, 1, 0))
    assert np.abs((normals[~cap] * around).sum(1)).min() > np.cos(np.radians(1))
    assert cap.sum() == 2 * 49 and (~cap).sum() == 2 * 48


def test_a_crease_is_kept_and_a_bend_is_smoothed():
    for angle, count in ((45, 4), (55, 6)):
        fold = np.radians(angle)
        vertices = np.array([[0, 0, 0], [0, 1, 0], [-1, 0, 0], [np.cos(fold), 0, np.sin(fold)]])
        assert len(smoothing.smoothed(vertices, np.array([[0, 1, 2], [1, 0, 3]]))[0]) == count


def test_large_faces_outweigh_small_ones():
    vertices = np.array([[0, 0, 0], [0, 1, 0], [-1, 0, 0], [0.01, 0, 0.005]])
    _, faces, normals, _ = smoothing.smoothed(vertices, np.array([[0, 1, 2], [1, 0, 3]]))
    shared = np.intersect1d(*faces)
    assert len(shared) == 2
    assert np.abs(unit(normals)[shared, 2]).min() > np.cos(np.radians(1))


def test_doubled_faces_are_smooth_too():
    ball = trimesh.creation.icosphere(subdivisions=3)
    both = np.concatenate([ball.faces, ball.faces[:, ::-1]])
    vertices, faces, normals, _ = smoothing.smoothed(ball.vertices, both)
    assert len(faces) == len(ball.faces)
    assert (unit(normals) * vertices).sum(1).min() > 0.999


def test_a_one_sided_surface_stays_as_it_is():
    turn = np.linspace(0, 2 * np.pi, 41)[:-1, None]
    across = np.array([-0.2, 0.2])
    radius = 0.7 + across * np.cos(turn / 2)
    strip = np.stack([radius * np.cos(turn), radius * np.sin(turn), across * np.sin(turn / 2)], -1)
    here = np.arange(40)
    left, right = 2 * here, 2 * here + 1
    # The last step meets the first upside down.
    left_next, right_next = np.r_[left[1:], right[0]], np.r_[right[1:], left[0]]
    faces = np.concatenate(
        [np.stack([left, right, right_next], 1), np.stack([left, right_next, left_next], 1)]
    )
    vertices, faces, normals, count = smoothing.smoothed(strip.reshape(-1, 3), faces)
    assert count == 0 and np.linalg.norm(normals, axis=1).min() > 0
    # Where the two sides meet, each keeps its normals: a mean of both would be of neither.
    flat = unit(smoothing.face_normals(vertices, faces))[:, None]
    assert np.sum(unit(normals)[faces] * flat, axis=-1).min() > 0.9


def test_an_edge_of_three_faces_is_a_crease():
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0.9, 0.1, 0], [0, 1, 0]], float)
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    vertices, faces, normals, _ = smoothing.smoothed(vertices, faces)
    assert len(vertices) == 9
    flat = unit(smoothing.face_normals(vertices, faces))
    np.testing.assert_allclose(unit(normals)[faces], flat[:, None].repeat(3, 1), atol=1e-6)
