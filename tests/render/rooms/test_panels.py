"""The solids that rooms are made of."""

import numpy as np
import pytest

from lime_keras.render.rooms import panels


@pytest.mark.parametrize("kind", ["box", "cylinder", "tube", "sphere"])
def test_solids_are_closed_and_face_outwards(kind):
    vertices, faces, normals, *_ = panels.solid(kind, (1, 2, 3), (0.5, 0.25, 0.75), 0.7)
    a, b, c = vertices[faces].swapaxes(0, 1) - (1, 2, 3)
    volume = (np.cross(a, b) * c).sum() / 6
    share = {"box": 1.0, "cylinder": np.pi / 4, "tube": np.pi / 4, "sphere": np.pi / 6}[kind]
    np.testing.assert_allclose(volume, 8 * 0.5 * 0.25 * 0.75 * share, rtol=0.04)
    flat = np.cross(b - a, c - a)
    assert (np.einsum("fk,fvk->fv", flat, normals[faces]) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-6)


def test_normals_of_an_ellipsoid_are_its_gradient():
    centre, extent = (1, 2, 3), (0.2, 0.5, 0.9)
    vertices, _, normals, *_ = panels.solid("sphere", centre, extent, 0.7)
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    gradient = (vertices - centre) @ turn.T / np.square(extent) @ turn
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    np.testing.assert_allclose(normals, gradient, atol=1e-9)
