"""The shadow on the ground, against closed forms."""

import mitsuba
import numpy as np
import pytest
import trimesh

from lime_keras.optics import environment
from lime_keras.render.scene import contact_shadow, lights
from lime_keras.render.scene.sampling import Pose
from lime_keras.render.shapes import meshes

SHAPE = environment.STORED_SHAPE
SIZE = 48
UP = np.array([0.0, 1.0, 0.0])
# From above: the picture's right is x, its top is −z of the mesh's frame.
FROM_ABOVE = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
ABOVE = FROM_ABOVE @ UP


def _mesh(tmp_path_factory, shape):
    path = tmp_path_factory.mktemp("meshes") / "mesh.ply"
    shape.export(path)
    return meshes.load(path)


@pytest.fixture(scope="module")
def ball(tmp_path_factory, mitsuba_choice):
    return _mesh(tmp_path_factory, trimesh.creation.icosphere(subdivisions=4))


def _seen_from_above(distance=20.0, width=8.0):
    """The pose, and the x and z of the ground under each pixel: about `width` radii of ground."""
    focal = SIZE * (distance + 1) / width
    pose = Pose(FROM_ABOVE, np.array([0, 0, -distance]), np.array([focal, focal, *[SIZE / 2] * 2]))
    step = (np.arange(SIZE) + 0.5 - SIZE / 2) / SIZE * width
    return pose, *np.meshgrid(step, step)


def _lamp(direction, degrees=6.0):
    """A map in camera space with a round lamp, of a direction in the mesh's frame."""
    towards = FROM_ABOVE @ (np.array(direction) / np.linalg.norm(direction))
    radiance = np.zeros(SHAPE)
    radiance[environment.directions(*SHAPE) @ towards > np.cos(np.radians(degrees))] = 10.0
    return lights.prepare("lamp", radiance)


def test_below_an_even_sky_a_ball_takes_its_form_factor(ball):
    """A ball of radius r on the ground takes (r / d)³ of the light at distance d of its middle."""
    pose, x, z = _seen_from_above()
    light = lights.prepare("sky", np.ones(SHAPE))
    found = contact_shadow.shade(ball, light, pose, ABOVE, SIZE)
    expected = (1 + x**2 + z**2) ** -1.5
    assert np.abs(found - expected).max() < 0.05
    assert np.mean(found - expected) == pytest.approx(0, abs=0.003)


def test_a_lamp_above_throws_the_outline(ball):
    pose, x, z = _seen_from_above()
    found = contact_shadow.shade(ball, _lamp((0, 1, 0), 3), pose, ABOVE, SIZE)
    radius = np.hypot(x, z)
    assert np.all(found[radius < 0.85] == 1) and np.all(found[radius > 1.15] == 0)


def test_the_shadow_lies_away_from_the_lamp(ball):
    """Its middle is where the line through the ball's middle meets the ground."""
    pose, x, z = _seen_from_above()
    found = contact_shadow.shade(ball, _lamp((1, 1, 0.5)), pose, ABOVE, SIZE)
    assert np.average(x, weights=found) == pytest.approx(-1, abs=0.12)
    assert np.average(z, weights=found) == pytest.approx(-0.5, abs=0.12)


@pytest.mark.parametrize("height", [0.4, 0.0], ids=["slab", "sheet"])
def test_the_ground_under_a_flat_bottom_is_dark(height, tmp_path_factory, mitsuba_choice):
    mesh = _mesh(tmp_path_factory, trimesh.creation.box((2.0, height, 2.0)))
    pose, x, z = _seen_from_above()
    half = np.abs(mesh.vertices[:, 0]).max()
    found = contact_shadow.shade(mesh, lights.prepare("sky", np.ones(SHAPE)), pose, ABOVE, SIZE)
    assert np.all(found[np.maximum(np.abs(x), np.abs(z)) < 0.95 * half] > 0.98)


def test_light_from_below_throws_no_shadow(ball):
    pose, _, _ = _seen_from_above()
    for light in (_lamp((0, -1, 0)), _lamp((1, -0.5, 0))):
        assert not contact_shadow.shade(ball, light, pose, ABOVE, SIZE).any()


def test_nothing_is_shadowed_above_the_horizon_or_from_below_the_ground(ball):
    light = lights.prepare("sky", np.ones(SHAPE))
    camera = np.array([SIZE, SIZE, SIZE / 2, SIZE / 2])
    level = Pose(np.eye(3), np.array([0, 0, -4.0]), camera)
    found = contact_shadow.shade(ball, light, level, UP, SIZE)
    assert not found[: SIZE // 2].any() and found[SIZE // 2 :].max() > 0.5
    above = Pose(np.eye(3), np.array([0, 3.0, -4.0]), camera)  # the ground is over the camera
    found = contact_shadow.shade(ball, light, above, UP, SIZE)
    assert np.isfinite(found).all() and not found[SIZE // 2 :].any()


def test_one_lit_texel_and_huge_or_tiny_light(ball):
    pose, x, z = _seen_from_above()
    one = np.zeros(SHAPE)
    # The texel of the camera's own direction, straight above.
    towards = environment.directions(*SHAPE) @ ABOVE
    one[np.unravel_index(np.argmax(towards), SHAPE)] = 1
    found = [
        contact_shadow.shade(ball, lights.prepare("texel", factor * one), pose, ABOVE, SIZE)
        for factor in (1.0, 1e30, 1e-30)
    ]
    assert found[0].max() == 1 and np.all(found[0][np.hypot(x, z) > 1.2] == 0)
    np.testing.assert_allclose(found[1], found[0], atol=1e-6)
    np.testing.assert_allclose(found[2], found[0], atol=1e-6)


def test_the_slow_variant_throws_the_same_shadow(ball, mitsuba_choice):
    pose, _, _ = _seen_from_above()
    pose = Pose(pose.rotation, pose.translation, pose.camera / 4)
    light = _lamp((1, 1, 0.5))
    fast = contact_shadow.shade(ball, light, pose, ABOVE, SIZE // 4)
    mitsuba.set_variant("scalar_rgb")
    try:
        slow = contact_shadow.shade(ball, light, pose, ABOVE, SIZE // 4)
    finally:
        mitsuba.set_variant(mitsuba_choice.variant)
    assert np.abs(slow - fast).max() < 0.15 and np.abs(slow - fast).mean() < 0.01


def test_parts_of_the_rays_make_the_same_shadow(ball, monkeypatch):
    pose, _, _ = _seen_from_above()
    light = lights.prepare("sky", np.ones(SHAPE))
    whole = contact_shadow.shade(ball, light, pose, ABOVE, SIZE)
    monkeypatch.setattr(contact_shadow, "_MOST_RAYS", 7)
    monkeypatch.setattr(contact_shadow, "_RAYS", 256)
    some = contact_shadow.shade(ball, light, pose, ABOVE, SIZE)
    np.testing.assert_array_equal(some, whole)
