"""Figures draw what they are given."""

import io

import numpy as np
import pytest
from matplotlib import image as png_reader

from lime_keras.eval.report import figures


def _pixels(png):
    return png_reader.imread(io.BytesIO(png), format="png")[..., :3]


def _confusion(matrix):
    return figures.confusions({"one": matrix})


def test_confusion_of_a_perfect_classifier_differs_from_a_constant_one():
    perfect = _confusion(np.eye(8, dtype=int) * 5)
    constant = _confusion(np.eye(8, dtype=int)[[3] * 8] * 5)
    assert np.any(_pixels(perfect) != _pixels(constant))


def test_confusion_with_empty_rows_is_drawn():
    assert _pixels(_confusion(np.zeros((8, 8), int))).std() > 0


def test_confusion_colours_shares_not_counts():
    few = np.zeros((8, 8), int)
    few[2, 2], few[5, 5] = 1, 1
    accent = np.array([0x1F, 0x63, 0xB0]) / 255

    def full_pixels(matrix):
        near = np.abs(_pixels(_confusion(matrix)) - accent).max(axis=-1) < 0.02
        return np.count_nonzero(near)

    assert full_pixels(few) > 1000
    assert full_pixels(few * 90) == pytest.approx(full_pixels(few), rel=0.1)
