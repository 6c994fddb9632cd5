"""Surfaces of revolution: creases at corners, normals across the slope."""

import numpy as np
from mesh_checks import is_closed

from lime_keras.render.shapes import lathe


def test_a_turned_cone_has_a_crease_and_the_slope_of_a_cone():
    class Plain:  # no flutes, no twist
        def integers(self, *_):
            return 3

        def uniform(self, *_):
            return 0.0

        def choice(self, *_, **__):
            return 0.0

    profile = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    mesh = lathe.turned(profile, Plain())
    assert is_closed(mesh)
    slope = np.array([2, 1]) / np.sqrt(5)
    side = mesh.normals[:, 1] > -0.5
    np.testing.assert_allclose(mesh.normals[side, 1], slope[1], atol=1e-5)
    np.testing.assert_allclose(mesh.normals[~side, 1], -1, atol=1e-5)
