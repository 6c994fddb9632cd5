"""Pictures of one example: renders by analytic light, one scale for truth and estimate."""

import dataclasses

import numpy as np
import pytest

from lime_keras.eval.report import renders
from lime_keras.eval.report.examples import Example, Selection
from lime_keras.optics import colour, environment, shading, shininess
from lime_keras.optics.reflectance_map import disc
from lime_keras.optics.shading import normaliser

SIZE = 16
SLOPE = 0.6


@pytest.fixture
def example():
    """A disc that faces the camera in a white furnace of radiance 1/2, estimated exactly."""
    y, x = np.mgrid[:SIZE, :SIZE] - SIZE / 2 + 0.5
    mask = (np.hypot(x, y) < 6).astype(np.float32)[..., None]
    camera = np.array([SIZE * 2, SIZE * 2, SIZE / 2, SIZE / 2], np.float32)
    normal = shading.view_directions(camera, SIZE, SIZE).astype(np.float32) * mask
    exponent = 10.0 ** shininess.LOG_MEANS[4]
    truth = {
        "image": np.full((SIZE, SIZE, 3), 0.25, np.float32),
        "mask": mask,
        "diffuse_shading": 0.5 * mask,
        "specular_shading": 0.5 * mask,
        "mirror": 0.5 * mask,
        "normal": normal,
        "environment": np.full((64, 128, 1), 0.5, np.float32),
        "camera": camera,
        "diffuse_albedo": np.array([0.2, 0.4, 0.6], np.float32),
        "specular_albedo": np.float32(0.5),
        "shininess": np.float32(exponent),
        "ambient": np.float32(0.01),
    }
    estimate = {
        "mask": mask,
        "specular_shading": 0.5 * mask,
        "mirror": 0.5 * mask,
        "diffuse_albedo": truth["diffuse_albedo"],
        "specular_albedo": np.array([0.5], np.float32),
        "exponent_bin_probabilities": np.eye(8, dtype=np.float32)[4],
    }
    return Example(Selection(0, "first"), truth, estimate, truth["image"])


def test_the_exponent_is_the_expected_one(example):
    assert example.exponent == pytest.approx(10.0 ** shininess.LOG_MEANS[4], rel=1e-5)


def test_the_true_render_is_equation_4(example):
    centre = renders.both(example)[0][SIZE // 2, SIZE // 2]
    expected = 0.01 + np.array([0.2, 0.4, 0.6]) * 0.5 + 0.5 * 0.5
    assert colour.srgb_to_linear(centre) == pytest.approx(expected, abs=1e-5)


def test_an_exact_estimate_renders_like_the_truth(example):
    """In a furnace, n = o: S is E whatever the exponent, so both renders agree everywhere."""
    assert np.abs(np.subtract(*renders.both(example))).max() < 5e-3


def test_the_estimated_exponent_shapes_the_highlight(example):
    """One lamp, 40° beside the axis: S = c(s) · cos(20°)^s · energy where n = o."""
    light = environment.directions(64, 128)
    row, column = np.unravel_index(np.argmax(light @ _at_angle(40)), (64, 128))
    lamp = np.zeros((64, 128, 1), np.float32)
    lamp[row, column] = 100.0
    energy = 100.0 * environment.solid_angles(64, 128)[row, column]
    example.truth["environment"] = lamp
    example.estimate["exponent_bin_probabilities"] = np.eye(8, dtype=np.float32)[1]
    s = 10.0 ** shininess.LOG_MEANS[1]
    pixel = SIZE // 2, SIZE // 2
    half = light[row, column] + (view := example.truth["normal"][pixel])
    highlight = normaliser(s) * (half @ view / np.linalg.norm(half)) ** s * energy
    expected = 0.01 + np.array([0.2, 0.4, 0.6]) * 0.5 + 0.5 * highlight
    assert expected.max() < 1 and highlight > 0.01
    centre = colour.srgb_to_linear(renders.both(example)[1][pixel])
    assert centre == pytest.approx(expected, rel=1e-3)


def _at_angle(degrees):
    """Unit direction in the horizontal plane, so far from the camera's axis."""
    return np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])


def test_the_printed_lobe_keeps_its_unit_of_m_s(example):
    factor = np.float32(shading.lobe_factor(example.exponent, "printed"))
    example.truth["specular_shading"] = example.truth["specular_shading"] * factor
    printed = dataclasses.replace(example, lobe="printed")
    assert np.abs(np.subtract(*renders.both(printed))).max() < 5e-3
    assert np.abs(np.subtract(*renders.both(example))).max() > 0.1


def test_the_background_is_the_photos_own(example):
    outside = example.truth["mask"][..., 0] == 0
    for picture in renders.both(example):
        assert picture[outside] == pytest.approx(0.25, abs=1e-5)


def test_a_wrong_albedo_shows_in_the_estimated_render_alone(example):
    right = renders.both(example)[0]
    example.estimate["diffuse_albedo"] = np.zeros(3, np.float32)
    true, estimated = renders.both(example)
    assert np.array_equal(true, right)
    centre = colour.srgb_to_linear(estimated[SIZE // 2, SIZE // 2])
    assert centre == pytest.approx(0.01 + 0.5 * 0.5, abs=5e-3)


def test_truth_and_estimate_share_one_scale(example):
    example.estimate["mirror"] = example.truth["mirror"] * np.float32(SLOPE)
    [(_, true, found)] = [p for p in renders.pairs(example) if p[0].startswith("Mirror")]
    inside = example.truth["mask"][..., 0] > 0
    assert true[inside] == pytest.approx(1.0)
    assert colour.srgb_to_linear(found[inside]) == pytest.approx(SLOPE, abs=1e-5)


@pytest.mark.parametrize("name", ["mask", "specular_shading", "mirror", "environment"])
def test_black_and_empty_layers_are_drawn(example, name):
    example.truth[name] = np.zeros_like(example.truth[name])
    for _, *pictures in renders.pairs(example):
        for picture in pictures:
            assert picture.shape == (SIZE, SIZE, 3)
            assert np.all(np.isfinite(picture)) and picture.min() >= 0 and picture.max() <= 1


def test_radiance_beyond_every_scale_is_clipped(example):
    for name in ("specular_shading", "mirror", "environment"):
        example.truth[name] = np.full_like(example.truth[name], 65504.0)
    example.estimate["mirror"] = np.full_like(example.truth["mirror"], 59873.0)
    for _, *pictures in renders.pairs(example):
        assert np.all(np.isfinite(pictures))


def test_layers_that_are_not_answered_are_not_shown(example):
    del example.estimate["mirror"]
    titles = [title for title, *_ in renders.pairs(example)]
    assert titles == ["Mask", "Specular shading S", "Rendered with the material"]


@pytest.mark.parametrize("lobe", ["furnace", "printed"])
def test_the_baselines_reflectance_map_is_shown_in_colour(example, lobe):
    """In a furnace of 1/2 the middle of the sphere is m_a + (m_d + m_s) / 2 (Eq. 4)."""
    example = dataclasses.replace(example, lobe=lobe)
    found = np.full((SIZE, SIZE, 3), 0.2, np.float32)
    found[..., 0] = 0.1
    for name in ("specular_shading", "mirror"):
        del example.estimate[name]
    example.estimate["reflectance_map"] = found * disc(SIZE)
    pairs = {title: pictures for title, *pictures in renders.pairs(example)}
    assert list(pairs) == ["Mask", "Reflectance map", "Rendered with the material"]
    factor = shading.lobe_factor(10.0 ** shininess.LOG_MEANS[4], lobe)
    middle = np.array([0.2, 0.4, 0.6]) * 0.5 + 0.5 * 0.5 * factor + 0.01
    pictures = pairs["Reflectance map"]
    shown, estimated = (colour.srgb_to_linear(one[SIZE // 2, SIZE // 2]) for one in pictures)
    white = middle[0] / shown[0]
    assert shown == pytest.approx(middle / white, rel=0.02)
    assert white == pytest.approx(middle[2], rel=0.02)
    assert estimated == pytest.approx(found[0, 0] / white, rel=0.02)
    for picture in pictures:
        assert picture.shape == (SIZE, SIZE, 3) and (picture[0, 0] == 0).all()


def test_a_regressed_exponent_is_the_examples(example):
    del example.estimate["exponent_bin_probabilities"]
    example.estimate["log_exponent"] = np.array([2.5], np.float32)
    assert example.exponent == pytest.approx(10**2.5, rel=1e-5)
    assert np.isfinite(renders.both(example)).all()
