"""Deformations: Jacobians and normals against differences, and nothing folds over."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from mesh_checks import check, flat_normals, is_balanced, volume

from lime_keras.render.shapes import deformation
from lime_keras.render.shapes.meshes import Mesh, normalised

KINDS = ("_stretch", "_shear", "_taper", "_twist", "_bend", "_waves")


def ball(subdivisions=4):
    shape = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Mesh(*(np.asarray(a, t) for a, t in zip(
        (shape.vertices, shape.faces, shape.vertices), ("f4", "u4", "f4"), strict=True
    )))  # fmt: skip


def box(a, b, c):
    shape = trimesh.creation.box((a, b, c))
    corners = shape.vertices[shape.faces].reshape(-1, 3)
    normals = np.repeat(shape.face_normals, 3, axis=0)
    return normalised(corners, np.arange(36).reshape(-1, 3), normals)


def points_in_the_ball(seed, count=60):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 1)


@pytest.mark.parametrize("kind", KINDS)
@given(seed=st.integers(0, 2**32))
@settings(max_examples=40)
def test_jacobians_are_the_derivatives_and_keep_the_side(kind, seed):
    step = getattr(deformation, kind)(np.random.default_rng(seed))
    points, h = points_in_the_ball(seed), 1e-6
    # In one call: a bend is bounded by the extent of all points.
    shifts = np.concatenate([np.zeros((1, 3)), h * np.eye(3), -h * np.eye(3)])
    moved, jacobians = step((points + shifts[:, None]).reshape(-1, 3))
    moved = moved.reshape(7, -1, 3)
    differences = (moved[1:4] - moved[4:]) / (2 * h)
    jacobians = jacobians.reshape(7, -1, 3, 3)[0]
    np.testing.assert_allclose(jacobians, differences.transpose(1, 2, 0), atol=1e-6)
    assert np.linalg.det(jacobians).min() > 0.05
    assert np.linalg.cond(jacobians).max() < 30


@given(seed=st.integers(0, 2**32))
@settings(max_examples=30)
def test_no_two_points_meet(seed):
    """A map whose points keep apart, also far from one another, does not fold over."""
    points = points_in_the_ball(seed, 300)
    for step in deformation.draw(np.random.default_rng(seed)):
        moved, _ = step(points)
        apart = np.linalg.norm(points[:, None] - points, axis=-1) + np.eye(len(points))
        after = np.linalg.norm(moved[:, None] - moved, axis=-1) + np.eye(len(points))
        assert (after / apart).min() > 0.04
        middle = (moved.min(0) + moved.max(0)) / 2
        points = (moved - middle) / np.linalg.norm(moved - middle, axis=1).max()


@given(seed=st.integers(0, 2**32))
@settings(max_examples=20)
def test_normals_of_a_deformed_ball_are_those_of_its_faces(seed):
    mesh = deformation.deformed(ball(), np.random.default_rng(seed))
    check(mesh)
    assert is_balanced(mesh)
    assert volume(mesh) > 0.02
    flat = flat_normals(mesh)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    cosine = (flat * mesh.normals[mesh.faces].mean(1)).sum(1)
    assert np.median(cosine) > 0.997 and cosine.min() > 0.8  # 0.9978 and 0.95 of 700 seeds


def test_a_stretched_ball_is_an_ellipsoid():
    points = ball(3).vertices.astype(float)
    matrix = np.diag([0.5, 1.0, 2.0])
    moved, jacobians = deformation._linear(matrix)(points)
    normals = deformation.turned(points, jacobians)
    exact = moved / np.diag(matrix) ** 2  # the gradient of x²/a² + y²/b² + z²/c²
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    np.testing.assert_allclose(normals, exact, atol=1e-12)


def test_a_bent_bar_is_an_arc():
    """The middle line of a thin bar keeps its length and has one curvature."""
    line = np.stack([0 * (t := np.linspace(-1, 1, 201)), 0 * t, t], 1)
    for seed in range(20):
        step = deformation._bend(np.random.default_rng(seed))
        arc, _ = step(line)
        lengths = np.linalg.norm(np.diff(arc, axis=0), axis=1)
        if lengths.std() < 1e-6:
            turning = np.diff(arc, 2, axis=0) / lengths[0] ** 2
            curvature = np.linalg.norm(turning, axis=1)
            np.testing.assert_allclose(curvature, curvature[0], rtol=1e-3, atol=1e-6)
            np.testing.assert_allclose(lengths.sum(), 2, rtol=1e-3)


def test_a_quarter_stays_as_it_was(monkeypatch):
    monkeypatch.setattr(deformation, "_LONGEST", 10)
    mesh = box(1, 2, 3)
    same = [deformation.deformed(mesh, np.random.default_rng(k)) is mesh for k in range(400)]
    assert np.mean(same) == pytest.approx(deformation.UNDEFORMED, abs=0.06)


def test_shapes_are_a_function_of_the_generator():
    mesh = box(1, 2, 3)
    for seed in range(8):
        one, other = (deformation.deformed(mesh, np.random.default_rng(seed)) for _ in range(2))
        np.testing.assert_array_equal(one.vertices, other.vertices)
        np.testing.assert_array_equal(one.normals, other.normals)


def test_flat_faces_take_on_curvature():
    """A box of twelve faces, bent, has many normals, and stays closed."""
    mesh = box(1, 2, 3)
    counts = []
    for seed in range(40):
        bent = deformation.deformed(mesh, np.random.default_rng(seed))
        check(bent)
        assert is_balanced(bent)
        counts.append(len(np.unique(bent.normals.round(2), axis=0)))
    assert np.mean(np.array(counts) > 50) > 0.4


@pytest.mark.parametrize(
    "vertices",
    [
        [[-1, 0, 0], [1, 0, 0], [0, 1e-7, 0], [0, -1e-7, 1e-7]],  # a needle
        [[-1, -1, 0], [1, -1, 0], [0, 1, 0], [0, 0, 1e-9]],  # nearly a single plane
        [[-1, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0]],  # no area at all
    ],
)
def test_degenerate_meshes_stay_finite(vertices):
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], "u4")
    normals = np.tile([0.0, 0.0, 1.0], (4, 1)).astype("f4")
    mesh = Mesh(np.array(vertices, "f4"), faces, normals)
    for seed in range(30):
        bent = deformation.deformed(mesh, np.random.default_rng(seed))
        assert np.isfinite(bent.vertices).all() and np.isfinite(bent.normals).all()
        np.testing.assert_allclose(np.linalg.norm(bent.normals, axis=1), 1, atol=1e-5)
