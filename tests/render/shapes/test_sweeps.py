"""Swept sections: rings and bars of known volume, frames that close, curves of known bend."""

import numpy as np
import pytest
from mesh_checks import is_balanced, share_on_the_side_of_the_normals, volume

from lime_keras.render.shapes import sweeps
from lime_keras.render.shapes.meshes import Mesh


def as_mesh(vertices, faces, normals):
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(vertices.astype("f4"), faces, normals)


def circle(count=200, radius=1.0):
    t = 2 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(t), np.sin(t), 0 * t], 1)


def trefoil(count=240):
    t = 2 * np.pi * np.arange(count) / count
    ring = 2 + np.cos(3 * t)
    return np.stack([ring * np.cos(2 * t), ring * np.sin(2 * t), np.sin(3 * t)], 1)


def test_a_tube_around_a_circle_is_a_torus():
    mesh = as_mesh(*sweeps.tube(circle(), 0.3, True, 48))
    assert is_balanced(mesh)
    assert volume(mesh) == pytest.approx(2 * np.pi**2 * 0.3**2, rel=0.01)
    x, y, z = mesh.vertices.T
    off = np.hypot(x, y) - 1
    np.testing.assert_allclose(np.hypot(off, z), 0.3, atol=1e-4)
    exact = np.stack([off * x / np.hypot(x, y), off * y / np.hypot(x, y), z], 1) / 0.3
    assert (mesh.normals * exact).sum(1).min() > 0.999


def test_an_open_tube_has_round_ends():
    line = np.linspace((0, 0, 0), (0, 0, 2), 30)
    mesh = as_mesh(*sweeps.tube(line, 0.25, False, 48))
    assert is_balanced(mesh)
    capsule = np.pi * 0.25**2 * 2 + 4 / 3 * np.pi * 0.25**3
    assert volume(mesh) == pytest.approx(capsule, rel=0.02)
    assert mesh.vertices[:, 2].max() == pytest.approx(2.25, abs=1e-3)


@pytest.mark.parametrize("turns", [0.0, 0.3, -2.0])
def test_a_square_bar_keeps_its_volume_and_corners(turns):
    line = np.linspace((0, 0, 0), (1, 2, 2), 400)
    section = sweeps.angular(np.array([[0.2, 0.1], [-0.2, 0.1], [-0.2, -0.1], [0.2, -0.1]]))
    mesh = as_mesh(*sweeps.swept(line, np.ones(400), section, False, turns))
    assert is_balanced(mesh)
    assert volume(mesh) == pytest.approx(0.4 * 0.2 * 3, rel=0.02)
    assert share_on_the_side_of_the_normals(mesh) == pytest.approx(1)


@pytest.mark.parametrize("turns", [0.0, 1.0, -2.0])
def test_on_a_knot_the_ends_of_the_section_meet(turns):
    """No edge along the knot is longer than the way of the curve and its turns ask for."""
    section = sweeps.angular(0.3 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]))
    vertices, faces, normals = sweeps.swept(trefoil(), np.ones(240), section, True, turns)
    mesh = as_mesh(vertices, faces, normals)
    assert is_balanced(mesh)
    assert share_on_the_side_of_the_normals(mesh) == pytest.approx(1)
    rows = vertices[: 240 * 2].reshape(240, 2, 3)
    steps = np.linalg.norm(np.roll(rows, -1, axis=0) - rows, axis=-1)
    assert steps[-1].max() < 1.3 * steps[:-1].max()


def test_frames_do_not_turn_about_the_curve():
    """On a plane curve, the carried normal keeps its angle with the plane."""
    first, second = sweeps._frames(circle(), sweeps._tangents(circle(), True), True, 0.0)
    np.testing.assert_allclose(first[:, 2], first[0, 2], atol=1e-9)
    np.testing.assert_allclose((first * second).sum(1), 0, atol=1e-9)


def test_the_tightest_bend_of_a_circle_is_its_radius():
    assert sweeps.tightest(circle(300, 0.7), True) == pytest.approx(0.7, rel=1e-3)
    assert sweeps.tightest(np.linspace((0, 0, 0), (1, 0, 0), 9), False) > 1e3


@pytest.mark.parametrize("closed", [False, True])
def test_splines_pass_their_points_and_even_points_are_even(closed):
    points = np.random.default_rng(3).normal(size=(6, 3))
    curve = sweeps.smooth(points, 5 * 20 + 1)
    np.testing.assert_allclose(curve[::20], points, atol=1e-9)
    even = sweeps.even(curve, 400, closed)
    steps = np.linalg.norm(np.diff(even, axis=0), axis=1)
    assert steps.max() < 1.2 * np.median(steps)
