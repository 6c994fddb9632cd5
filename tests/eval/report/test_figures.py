"""Figures draw what they are given, and nothing at all when there is nothing."""

import io

import numpy as np
import pytest
from matplotlib import image as png_reader

from lime_keras.eval.report import figures, themes


def _pixels(png):
    return png_reader.imread(io.BytesIO(png), format="png")[..., :3]


def test_confusion_of_a_perfect_classifier_differs_from_a_constant_one():
    perfect = figures.confusion(np.eye(8, dtype=int) * 5)
    constant = figures.confusion(np.eye(8, dtype=int)[[3] * 8] * 5)
    assert np.any(_pixels(perfect) != _pixels(constant))


def test_confusion_with_empty_rows_is_drawn():
    assert _pixels(figures.confusion(np.zeros((8, 8), int))).std() > 0


def test_confusion_colours_shares_not_counts():
    few = np.zeros((8, 8), int)
    few[2, 2], few[5, 5] = 1, 1
    accent = np.array([0x1F, 0x63, 0xB0]) / 255

    def full_pixels(matrix):
        near = np.abs(_pixels(figures.confusion(matrix)) - accent).max(axis=-1) < 0.02
        return np.count_nonzero(near)

    assert full_pixels(few) > 1000
    assert full_pixels(few * 90) == pytest.approx(full_pixels(few), rel=0.1)


def test_the_dark_theme_is_dark():
    matrix = np.eye(8, dtype=int)
    light, dark = (_pixels(figures.confusion(matrix, t)) for t in (themes.LIGHT, themes.DARK))
    assert np.median(light) > 0.9
    assert np.median(dark) < 0.3


def test_albedos_of_one_example_are_drawn():
    rows = {
        "bin": np.array([0]),
        "diffuse_albedo": np.array([[0.1, 0.5, 0.9]]),
        "diffuse_found": np.array([[0.2, 0.5, 0.8]]),
        "specular_albedo": np.array([0.3]),
        "specular_found": np.array([0.4]),
    }
    assert _pixels(figures.albedos(rows)).std() > 0
