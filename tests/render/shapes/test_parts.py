"""Parts: solids placed, joined and turned into surfaces with normals."""

import numpy as np
import pytest
from manifold3d import Manifold
from mesh_checks import is_balanced, volume

from lime_keras.render.shapes import carving, parts
from lime_keras.render.shapes.meshes import Mesh


def as_mesh(part):
    return Mesh(*(np.asarray(array) for array in part))


def test_a_box_has_flat_faces_and_a_ball_none():
    _, _, normals = parts.of_solid(Manifold.cube((1, 2, 3)))
    np.testing.assert_allclose(np.sort(np.abs(normals), axis=1), [[0, 0, 1]] * 24, atol=1e-6)
    vertices, _, normals = parts.of_solid(Manifold.sphere(1.0, 64))
    assert (vertices * normals).sum(1).min() > 0.999


def test_joined_parts_keep_their_faces():
    near, far = (parts.of_solid(Manifold.cube((1, 1, 1)).translate((x, 0, 0))) for x in (0.0, 5.0))
    both = as_mesh(parts.joined([near, far]))
    assert is_balanced(both)
    assert volume(both) == pytest.approx(2)
    np.testing.assert_allclose(both.vertices.max(0), [6, 1, 1])


@pytest.mark.parametrize("seed", range(8))
def test_frames_and_turns_are_rotations(seed):
    rng = np.random.default_rng(seed)
    axis = parts.direction(rng) if seed else np.array([0.0, 0.0, 1.0])
    frame = parts.frame_along(axis)
    np.testing.assert_allclose(frame[:, 2], axis)
    for rotation in (frame, parts.turn(rng)):
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)


def test_carving_leaves_a_share_of_the_solid_in_one_piece(monkeypatch):
    """Changes that would take nearly everything are not made."""
    monkeypatch.setattr(carving, "_carved", lambda rng, solid: Manifold())
    mesh = carving.sample(np.random.default_rng(0))
    assert volume(mesh) > 0.05

    def extent(change):
        monkeypatch.setattr(carving, "_carved", lambda rng, solid: change(solid))
        return np.ptp(carving.sample(np.random.default_rng(0)), axis=0).max()

    def smaller(share):
        factor = (share * carving._LEAST_LEFT) ** (1 / 3)
        return extent(lambda solid: solid.scale((factor, factor, factor)))

    monkeypatch.setattr(carving, "normalised", lambda *arrays: np.asarray(arrays[0]))
    whole = extent(lambda solid: solid)
    assert smaller(0.9) == pytest.approx(whole) and smaller(1.1) < 0.9 * whole
    assert extent(lambda solid: solid + solid.translate((9, 0, 0))) == pytest.approx(whole)
