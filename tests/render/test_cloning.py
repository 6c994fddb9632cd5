"""Cloning: where the mesh comes to stand, how bright it is, and that the old object is gone."""

import dataclasses

import numpy as np
import pytest
import trimesh
from skimage.metrics import structural_similarity

from lime_keras.material import Material
from lime_keras.optics import colour, environment, shading
from lime_keras.render import cloning

SHAPE = environment.STORED_SHAPE
EVEN = np.full(SHAPE, 0.5)
DULL = Material(np.array([0.8, 0.4, 0.2]), 0.0, 10.0)


@pytest.fixture(scope="module")
def ball(tmp_path_factory, mitsuba_choice):
    path = tmp_path_factory.mktemp("meshes") / "ball.ply"
    trimesh.creation.icosphere(subdivisions=4).export(path)
    return path


@pytest.fixture(scope="module")
def slab(tmp_path_factory, mitsuba_choice):
    path = tmp_path_factory.mktemp("meshes") / "slab.ply"
    trimesh.creation.box((2.0, 0.5, 0.3)).export(path)
    return path


def _photo(height=80, width=120, box=(20, 60, 30, 70)):
    """A red block before a grey ramp: the photo and its mask."""
    photo = np.repeat(np.linspace(0.2, 0.6, width)[None, :, None], height, axis=0)
    photo = np.broadcast_to(photo, (height, width, 3)).astype(np.float32).copy()
    mask = np.zeros((height, width, 1), np.float32)
    top, bottom, left, right = box
    mask[top:bottom, left:right] = 1
    photo[top:bottom, left:right] = (1.0, 0.0, 0.0)
    return photo, mask


PHOTO, MASK = _photo()


def _box(changed):
    rows, columns = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
    return rows[0], rows[-1] + 1, columns[0], columns[-1] + 1


def _covered(photo, mask, mesh):
    """Which pixels the mesh changes: a black one against a bright one."""
    black = dataclasses.replace(DULL, diffuse_albedo=np.zeros(3))
    pictures = [cloning.clone(photo, mask, material, EVEN, mesh) for material in (DULL, black)]
    return np.abs(pictures[0] - pictures[1]).max(axis=-1) > 0.02


@pytest.mark.parametrize(
    "box", [(20, 60, 30, 70), (5, 45, 0, 40), (40, 80, 80, 120), (0, 80, 10, 90), (30, 34, 50, 54)]
)
def test_a_ball_fills_the_objects_box(ball, box):
    found = _box(_covered(*_photo(box=box), ball))
    assert np.abs(np.subtract(found, box)).max() <= 1


def test_what_is_flat_stands_on_the_boxs_lower_edge(slab):
    top, bottom, left, right = _box(_covered(*_photo(), slab))
    assert bottom == 60 and abs(left - 30) <= 1 and abs(right - 70) <= 1
    assert 30 < top


def test_the_mesh_turns_about_its_vertical(slab, monkeypatch):
    turned = cloning.clone(PHOTO, MASK, DULL, EVEN, slab)
    monkeypatch.setattr(cloning, "_TURN", 0.0)
    front = cloning.clone(PHOTO, MASK, DULL, EVEN, slab)
    assert structural_similarity(front, turned, channel_axis=-1, data_range=1.0) < 0.98


def test_a_mesh_whose_up_is_z_stands_as_one_whose_up_is_y(slab, tmp_path):
    """The same slab, written with z up."""
    path = tmp_path / "slab.ply"
    mesh = trimesh.load(slab)
    x, y, z = mesh.vertices.T
    mesh.vertices = np.stack([x, -z, y], axis=-1)
    mesh.export(path)
    expected = cloning.clone(PHOTO, MASK, DULL, EVEN, slab)
    found = cloning.clone(PHOTO, MASK, DULL, EVEN, path, up="z")
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert np.abs(cloning.clone(PHOTO, MASK, DULL, EVEN, path) - expected).max() > 0.1


@pytest.mark.parametrize("up", cloning.UPRIGHT)
def test_upright_is_a_rotation_that_lifts_the_axis(up):
    rotation = cloning.UPRIGHT[up]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1)
    np.testing.assert_allclose(rotation @ np.eye(3)["xyz".index(up)], [0, 1, 0])


def test_a_shadow_darkens_the_ground_beside_the_lamp_and_nothing_else(ball):
    """Lamp from the upper left: a shadow at the right, of the ground's own hue."""
    towards = np.array([-1.0, 1.0, 0.3]) / np.linalg.norm([1.0, 1.0, 0.3])
    light = np.where(environment.directions(*SHAPE) @ towards > 0.95, 20.0, 0.0)
    photo, mask = _photo(120, 200, (20, 60, 80, 120))
    photo[..., 2] *= 0.5
    without = cloning.clone(photo, mask, DULL, light, ball)
    found = cloning.clone(photo, mask, DULL, light, ball, shadow=True)
    darker = (found < without - 0.02).any(-1)
    assert np.all(found <= without + 1e-6) and darker[:, 110:].sum() > 4 * darker[:, :90].sum()
    assert np.array_equal(found[:30], without[:30])
    assert np.array_equal(found[40, 100], without[40, 100])  # not on the object itself
    share = colour.srgb_to_linear(found[darker]) / colour.srgb_to_linear(without[darker])
    outside = np.ptp(share, axis=-1) < 0.02
    assert outside.mean() > 0.8 and share.min() >= 0


def test_a_shadow_of_light_from_below_changes_nothing(ball):
    light = np.where(environment.directions(*SHAPE)[..., 1] < -0.5, 1.0, 0.0)
    with_shadow, without = (
        cloning.clone(PHOTO, MASK, DULL, light, ball, shadow=shadow) for shadow in (True, False)
    )
    np.testing.assert_array_equal(with_shadow, without)


@pytest.mark.parametrize("shadow", [False, True])
def test_a_transparent_background_stays(ball, shadow):
    """A cut-out: composed over any ground it is as the clone in a photo of that ground."""
    cut = MASK * np.array([1.0, 0, 0], np.float32)
    found = cloning.clone(cut, MASK, DULL, EVEN, ball, shadow=shadow, alpha=MASK)
    assert found.shape == (80, 120, 4) and found.dtype == np.float32
    assert np.all(found[..., :3] <= found[..., 3:] + 1e-6) and found.min() >= 0
    assert found[:16].max() == 0 and found[40, 50, 3] == 1
    for level in (0.0, 0.7):
        ground = np.full((80, 120, 3), level, np.float32)
        seen = cloning.clone(np.where(MASK > 0, cut, ground), MASK, DULL, EVEN, ball, shadow=shadow)
        alpha = found[..., 3:]
        colours = colour.srgb_to_linear(found[..., :3] / np.maximum(alpha, 1e-9))
        linear = alpha * colours + (1 - alpha) * colour.srgb_to_linear(ground)
        np.testing.assert_allclose(colour.linear_to_srgb(linear), seen, atol=0.01)


def test_alpha_of_one_changes_nothing(ball):
    plain = cloning.clone(PHOTO, MASK, DULL, EVEN, ball, shadow=True)
    found = cloning.clone(PHOTO, MASK, DULL, EVEN, ball, shadow=True, alpha=np.ones_like(MASK))
    np.testing.assert_allclose(found[..., :3], plain, atol=1e-6)
    assert np.all(found[..., 3] == 1)


def test_a_half_transparent_photo_keeps_its_alpha(ball):
    half = np.full_like(MASK, 0.5)
    found = cloning.clone(0.5 * PHOTO, MASK, DULL, EVEN, ball, alpha=half)
    far = np.ones(MASK.shape[:2], bool)
    far[15:65, 25:75] = False
    assert np.array_equal(found[far, :3], 0.5 * PHOTO[far]) and np.all(found[far, 3] == 0.5)
    assert found[40, 50, 3] == 1
    tiny = cloning.clone(PHOTO, MASK, DULL, EVEN, ball, alpha=np.full_like(MASK, 1e-38))
    assert np.isfinite(tiny).all() and tiny.max() <= 1
    straight = cloning.clone(PHOTO, MASK, DULL, EVEN, ball)
    np.testing.assert_allclose(found[40, 50, :3], straight[40, 50], atol=1e-5)


def test_in_a_furnace_the_ball_has_its_albedos_colour(ball):
    """Linear radiance m_d · 0.5, in the photo's own unit, as sRGB."""
    picture = cloning.clone(PHOTO, MASK, DULL, EVEN, ball)
    expected = colour.linear_to_srgb(0.5 * DULL.diffuse_albedo)
    assert picture[40, 50] == pytest.approx(expected, abs=2e-3)
    brighter = cloning.clone(PHOTO, MASK, DULL, 10 * EVEN, ball)
    assert brighter[40, 50] == pytest.approx(np.ones(3), abs=1e-5)


def test_light_from_the_right_lights_the_right_side(ball):
    light = 0.01 + 3 * np.maximum(environment.directions(*SHAPE) @ np.array([1.0, 0, 0]), 0)
    picture = cloning.clone(PHOTO, MASK, DULL, light, ball)
    assert picture[40, 62, 0] > picture[40, 38, 0] + 0.2


def test_the_highlight_is_where_eq_3_puts_it(ball):
    light = np.zeros(SHAPE)
    towards = np.array([0.5, 0.5, 0.7]) / np.linalg.norm([0.5, 0.5, 0.7])
    directions = environment.directions(*SHAPE)
    light[directions @ towards > np.cos(np.radians(8))] = 20.0
    glossy = Material(np.zeros(3), 0.5, 100.0)
    photo, mask = _photo(240, 240, (60, 180, 60, 180))
    picture = cloning.clone(photo, mask, glossy, light, ball)[..., 0]
    row, column = np.mean(np.argwhere(picture > 0.95 * picture[60:180, 60:180].max()), axis=0)
    half = towards + shading.view_directions(shading.assumed_camera(240, 240), 240, 240)[120, 120]
    half /= np.linalg.norm(half)
    assert (column + 0.5 - 120) / 60 == pytest.approx(half[0], abs=0.06)
    assert (120 - row - 0.5) / 60 == pytest.approx(half[1], abs=0.06)


def test_the_old_object_is_gone_and_the_rest_untouched(slab):
    picture = cloning.clone(PHOTO, MASK, DULL, EVEN, slab)
    ramp, _ = _photo(box=(0, 0, 0, 0))
    assert np.abs(picture - ramp)[:28].max() < 0.02  # above the slab, where the block was
    far = np.ones(PHOTO.shape[:2], bool)
    far[15:65, 25:75] = False
    assert np.array_equal(picture[far], PHOTO[far])


def test_edges_are_antialiased(ball):
    photo, mask = _photo(240, 240, (60, 180, 60, 180))
    white = dataclasses.replace(DULL, diffuse_albedo=np.ones(3))
    picture = cloning.clone(0 * photo, mask, white, 2 * EVEN, ball)[..., 0]
    between = (picture > 0.05) & (picture < 0.95)
    assert 200 < np.sum(between) < 1000


def test_large_objects_are_rendered_smaller_and_enlarged(ball, monkeypatch):
    full = cloning.clone(PHOTO, MASK, DULL, EVEN, ball)
    monkeypatch.setattr(cloning, "_MOST_PIXELS", 24)
    coarse = cloning.clone(PHOTO, MASK, DULL, EVEN, ball)
    assert np.mean(np.abs(full - coarse)) < 0.01
    assert coarse[40, 50] == pytest.approx(full[40, 50], abs=1e-3)


@pytest.mark.parametrize("box", [(0, 80, 0, 120), (40, 41, 60, 61)])
def test_an_object_as_large_as_the_photo_or_a_pixel(ball, box):
    photo, mask = _photo(box=box)
    picture = cloning.clone(photo, mask, DULL, EVEN, ball)
    middle = tuple(np.argwhere(mask[..., 0]).mean(0).astype(int))
    assert picture.shape == (80, 120, 3) and not np.array_equal(picture[middle], photo[middle])
    assert picture.dtype == np.float32
    assert picture.min() >= 0 and picture.max() <= 1


def test_what_cannot_be_cloned_is_told(ball, tmp_path):
    with pytest.raises(ValueError, match="without `only`"):
        cloning.clone(PHOTO, MASK, dataclasses.replace(DULL, exponent=None), EVEN, ball)
    with pytest.raises(ValueError, match="must shine"):
        cloning.clone(PHOTO, MASK, DULL, 0 * EVEN, ball)
    with pytest.raises(ValueError, match="finite"):
        cloning.clone(PHOTO, MASK, DULL, np.nan * EVEN, ball)
    with pytest.raises(ValueError, match=r"none\.ply .*No such file"):
        cloning.clone(PHOTO, MASK, DULL, EVEN, tmp_path / "none.ply")
