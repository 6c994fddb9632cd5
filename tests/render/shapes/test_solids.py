"""Polygonised fields: the normals are the field's own."""

import numpy as np

from lime_keras.render.shapes import fields, solids


def test_a_ball_has_the_normals_of_a_ball():
    mesh = solids.polygonise(lambda p: np.sqrt((p**2).sum(0)) - np.float32(0.7), 1.0)
    assert (mesh.vertices * mesh.normals).sum(1).min() > 0.999


def test_a_box_keeps_flat_sides():
    extent = np.array([[0.3], [0.4], [0.5]], np.float32)
    mesh = solids.polygonise(lambda p: fields._box(p, extent, 0.02), 1.0)
    assert (np.abs(mesh.normals).max(1) > 0.999).mean() > 0.85
