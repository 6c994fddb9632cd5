"""What the overlay shows."""

import numpy as np
import pytest

from lime_keras.material import Material
from lime_keras.optics import colour
from lime_keras.video.overlay import draw, panel

FUSED = Material(np.array([0.8, 0.2, 0.05]), 0.5, 60.0)
NOTHING = Material()


def estimate(mask=None, **fields):
    layers = {} if mask is None else {"mask": np.asarray(mask, np.float32)[..., None]}
    return Material(layers=layers, **fields)


@pytest.mark.parametrize(
    "shape", [(48, 64), (64, 48), (1, 1), (1, 500), (500, 1), (33, 77), (481, 1281), (720, 1280)]
)
def test_frames_of_every_shape_get_a_panel(shape):
    image = np.full((*shape, 3), 200, np.uint8)
    drawn = draw(image, 0.0, "", estimate(np.ones(shape)), FUSED)
    assert drawn.dtype == np.uint8 and drawn.shape[0] == 480 and drawn.shape[1] % 2 == 0
    assert drawn.shape[1] <= 1280 + 380
    shown = np.any(np.all(drawn[:, :-380] == 200, axis=-1), axis=0)
    assert shown.all()
    np.testing.assert_array_equal(drawn[:, -380:], panel(0.0, "", estimate(), FUSED))


def test_the_picture_keeps_its_proportions():
    image = np.full((100, 400, 3), 90, np.uint8)
    drawn = draw(image, 0.0, "", estimate(), FUSED)[:, :-380]
    assert drawn.shape[1] == 1280
    assert np.all(drawn == 90, axis=(1, 2)).sum() == 320


def test_the_outline_runs_along_the_masks_rim_and_nowhere_else():
    row, column = np.mgrid[:120, :160]
    mask = np.hypot(row - 60, column - 80) < 40
    image = np.full((120, 160, 3), 128, np.uint8)
    drawn = draw(image, 0.0, "", estimate(mask), FUSED)[:, :640]
    marked = np.any(drawn != 128, axis=-1)
    row, column = np.mgrid[:480, :640]
    radius = np.hypot(row + 0.5 - 240, column + 0.5 - 320) / 4
    assert marked.sum() > 2 * np.pi * 160 and (marked <= (np.abs(radius - 40) < 2)).all()
    np.testing.assert_array_equal(np.unique(drawn[marked], axis=0), [[255, 225, 0]])


@pytest.mark.parametrize("level", [0, 1])
def test_no_rim_no_outline(level):
    image = np.full((48, 64, 3), 128, np.uint8)
    drawn = draw(image, 0.0, "", estimate(np.full((48, 64), level)), FUSED)
    assert (drawn[:, :640] == 128).all()


def test_a_mask_of_another_resolution_is_fitted():
    image = np.full((480, 640, 3), 128, np.uint8)
    mask = np.zeros((12, 16))
    mask[3:9, 4:12] = 1
    drawn = draw(image, 0.0, "", estimate(mask), FUSED)[:, :640]
    rows, columns = np.nonzero(np.any(drawn != 128, axis=-1))
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (120, 359, 160, 479)


def test_swatches_show_both_albedos():
    raw = np.array([0.1, 0.4, 0.9])
    pixels = panel(1.0, "", estimate(diffuse_albedo=raw), FUSED)
    for top, albedo in ((44, raw), (158, FUSED.diffuse_albedo)):
        expected = np.rint(255 * colour.linear_to_srgb(albedo))
        np.testing.assert_array_equal(pixels[top + 10, 22], expected)


def ball(material):
    """Decoded sphere, of the panel."""
    return colour.srgb_to_linear(panel(0.0, "", NOTHING, material)[276:468, 94:286] / 255.0)


def test_the_sphere_is_of_the_fused_material():
    bare = ball(NOTHING)
    assert np.ptp(bare, axis=(0, 1)).max() == 0
    matt = ball(Material(np.array([0.8, 0.2, 0.05]), 0.0, 60.0))
    middle = matt[60:130, 60:130].mean(axis=(0, 1))
    np.testing.assert_allclose(middle / middle[0], np.array([0.8, 0.2, 0.05]) / 0.8, atol=0.02)
    black = np.zeros(3)
    dull, shiny = (ball(Material(black, 0.2, exponent)) for exponent in (2.0, 900.0))
    assert np.ptp(shiny[60:130, 60:130]) > 2 * np.ptp(dull[60:130, 60:130])
    np.testing.assert_array_equal(shiny[0, 0], matt[0, 0])  # beside the sphere


@pytest.mark.parametrize("missing", ["diffuse_albedo", "specular_albedo", "exponent"])
def test_what_is_unknown_is_left_out(missing):
    fields = {"diffuse_albedo": FUSED.diffuse_albedo, "specular_albedo": 0.5, "exponent": 60.0}
    whole = panel(0.0, "", NOTHING, FUSED)
    partial = panel(0.0, "", NOTHING, Material(**(fields | {missing: None})))
    empty = panel(0.0, "", NOTHING, NOTHING)
    np.testing.assert_array_equal(partial[276:468, 94:286], empty[276:468, 94:286])
    assert (partial != empty).any() and (partial[:270] != whole[:270]).any()


@pytest.mark.parametrize("status", ["", "no object", "new scene"])
def test_time_and_status_are_told(status):
    shown, bare = panel(1.25, status, NOTHING, FUSED), panel(1.25, "", NOTHING, FUSED)
    assert (shown[:50] != bare[:50]).any() == bool(status)
    assert (panel(1.26, "", NOTHING, FUSED)[:50] != bare[:50]).any()


@pytest.mark.parametrize("albedo", [0.0, 1.0, np.float32(1e-30)])
@pytest.mark.parametrize("exponent", [1.0, 1000.0, 1e-12, 1e9])
def test_extreme_materials_are_drawn(albedo, exponent):
    material = Material(np.full(3, albedo), float(albedo), exponent, mask_coverage=1.0)
    assert panel(1e9, "", material, material).shape == (480, 380, 3)
