"""The light that materials are shown under."""

import numpy as np
import pytest

from lime_keras.estimate import preview
from lime_keras.material import Material
from lime_keras.optics import environment, studio_light


def _levels(diffuse, specular, exponent):
    material = Material(np.full(3, diffuse), specular, exponent)
    return 255 * preview.sphere(material, 64)[..., 0]


def test_a_later_light_hides_those_before_it():
    light = studio_light.light()
    assert light.shape == environment.STORED_SHAPE and not light.flags.writeable
    assert set(np.unique(light)) == {0.0, *(strength for _, _, strength in studio_light.LIGHTS)}


@pytest.mark.parametrize("exponent", [1.0, 20.0])
def test_white_is_white_and_not_burnt_out(exponent):
    assert 220 < _levels(0.75, 0.05, exponent).max() < 236


def test_a_specular_albedo_of_a_plastic_shows_its_gloss():
    """Height of the highlight over the same surface without one, in levels."""
    dull = _levels(0.3, 0.0, 1.0)
    heights = [(_levels(0.3, 0.05, s) - dull).max() for s in (5.0, 20.0, 60.0, 250.0)]
    assert heights == sorted(heights)
    assert heights[1] < 25 < heights[2] < 60 < heights[3]
