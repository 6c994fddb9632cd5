"""Profiles and extrusions: distances, volumes, and one piece each."""

import numpy as np
import pytest
from manifold3d import CrossSection
from mesh_checks import is_balanced, volume

from lime_keras.render.shapes import extrusion, profiles


def test_the_distance_to_a_square_with_a_hole_is_exact():
    outline = CrossSection.square((2, 2), center=True) - CrossSection.square((1, 1), center=True)
    points = np.random.default_rng(0).uniform(-1.2, 1.2, (2, 4000)).astype(np.float32)

    def square(half):  # the signed distance to it
        q = np.abs(points) - half
        return np.hypot(*np.maximum(q, 0)) + np.minimum(q.max(0), 0)

    exact = np.maximum(square(1.0), -square(0.5))
    exact = np.where(exact > 0, np.where(square(1.0) > 0, square(1.0), -square(0.5)), exact)
    found = extrusion.distance(outline)(points)
    assert np.abs(found - exact).max() < 0.03  # a table of this width
    assert (np.sign(found) == np.sign(exact))[np.abs(exact) > 0.02].all()


def test_every_profile_is_one_piece_about_the_unit_circle():
    for seed in range(200):
        rng = np.random.default_rng(seed)
        outline = profiles.draw(rng)
        assert outline.area() > 0.02 and len(outline.decompose()) == 1
        assert np.abs(outline.bounds()).max() < 1.7
        assert profiles.convex(rng).num_contour() == 1


def test_profiles_have_corners_curves_and_holes():
    drawn = [profiles.draw(np.random.default_rng(seed)) for seed in range(120)]
    holes = np.array([outline.num_contour() > 1 for outline in drawn])
    assert 0.15 < holes.mean() < 0.6
    assert min(outline.num_vert() for outline in drawn) < 6
    assert max(outline.num_vert() for outline in drawn) > 60


@pytest.mark.parametrize("seed", range(6))
def test_a_bevelled_extrusion_is_closed(seed):
    mesh = extrusion.bevelled(np.random.default_rng(seed), 8_000)
    assert is_balanced(mesh) and volume(mesh) > 1e-3


def test_an_extrusion_has_sharp_edges():
    creased = 0
    for seed in range(10):
        mesh = extrusion.sharp(np.random.default_rng(seed))
        creased += len(np.unique(mesh.vertices, axis=0)) < len(mesh.vertices)
    assert creased == 10
