"""The solids that rooms are made of."""

import numpy as np
import pytest

from lime_keras.render.room_meshes import Solid, solid_piece


@pytest.mark.parametrize("kind", ["box", "cylinder", "tube", "sphere"])
def test_solids_are_closed_and_face_outwards(kind):
    solid = Solid(kind, (1.0, 2.0, 3.0), (0.5, 0.25, 0.75), 0.7, 0.5)
    vertices, normals, faces, *_ = solid_piece(solid)
    a, b, c = vertices[faces].swapaxes(0, 1) - np.array(solid.centre)
    volume = (np.cross(a, b) * c).sum() / 6
    share = {"box": 1.0, "cylinder": np.pi / 4, "tube": np.pi / 4, "sphere": np.pi / 6}[kind]
    np.testing.assert_allclose(volume, 8 * 0.5 * 0.25 * 0.75 * share, rtol=0.04)
    flat = np.cross(b - a, c - a)
    assert (np.einsum("fk,fvk->fv", flat, normals[faces]) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-6)
