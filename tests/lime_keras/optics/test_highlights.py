"""Holes of the diffuse part, where a highlight hides it."""

import numpy as np
import pytest

from lime_keras.optics import colour, highlights


def test_what_a_highlight_or_the_camera_hides():
    image = np.full((1, 4, 3), 0.5, np.float32)
    image[0, 1] = (1.0, 0.2, 0.2)
    image[0, 2] = 0
    linear = float(colour.srgb_to_linear(0.5))
    specular = np.full((1, 4, 1), 0.49 * linear, np.float32)
    specular[0, 2] = 0
    specular[0, 3] = 0.51 * linear
    assert highlights.hidden(image, specular).tolist() == [[False, True, False, True]]


@pytest.mark.parametrize("shape", [(64, 64), (40, 700), (1, 1), (1, 300), (513, 3)])
def test_one_colour_closes_every_hole_with_itself(shape):
    rng = np.random.default_rng(0)
    known = rng.uniform(size=shape) < 0.5
    known[0, 0] = True
    values = np.full((*shape, 3), (0.7, 0.2, 0.1), np.float32)
    values[~known] = np.nan
    found = highlights.inpainted(np.nan_to_num(values), known, ~known)
    assert found.shape == (np.count_nonzero(~known), 3)
    np.testing.assert_allclose(found, np.broadcast_to([0.7, 0.2, 0.1], found.shape), rtol=2e-2)


def test_a_slope_goes_on_through_a_hole():
    """Against the slope that was taken away; a hole of an eighth of the side."""
    y, x = np.mgrid[:200, :200] / 200
    values = (0.2 + 0.3 * x + 0.2 * y)[..., None]
    hole = np.hypot(x - 0.5, y - 0.5) < 0.06
    found = highlights.inpainted(np.where(hole[..., None], 0, values), ~hole, hole)
    np.testing.assert_allclose(found, values[hole], atol=0.03)


def test_nothing_known_is_black():
    nothing = np.zeros((5, 7), bool)
    found = highlights.inpainted(np.ones((5, 7, 3), np.float32), nothing, ~nothing)
    assert found.shape == (35, 3) and not found.any()
