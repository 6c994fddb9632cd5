"""Measures of lights at their limits, and the page of their histograms."""

import numpy as np
import pytest
from small_lights import SHAPE, bank, suns

from lime_keras.optics import environment
from lime_keras.render.bank import light_histograms as histograms

TILT = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
"""Turns the map's vertical to the camera."""


def test_a_furnace_has_no_contrast_and_no_direction():
    found = histograms.measures(np.full(SHAPE, 3.0), TILT)
    assert found["contrast"] == found["peak"] == pytest.approx(0)
    assert found["brightest"] == pytest.approx(0.005, rel=1e-3)
    assert found["directed"] == pytest.approx(0, abs=1e-12)
    assert found["front"] == pytest.approx(0.5)


def test_one_lit_texel_is_all_contrast_and_direction():
    radiance = np.zeros(SHAPE)
    radiance[2, 5] = 7
    found = histograms.measures(radiance, TILT)
    assert found["brightest"] == found["front"] == pytest.approx(1)
    assert found["directed"] == pytest.approx(1)
    share = environment.solid_angles(*SHAPE)[2, 5] / (4 * np.pi)
    assert found["peak"] == pytest.approx(-np.log10(share))
    assert found["strongest"] == pytest.approx(environment.directions(*SHAPE)[2, 5, 1])
    assert np.isfinite(found["contrast"])


def test_the_brightest_texels_are_counted_by_solid_angle():
    """Half of the energy in a hundredth of the sphere: a quarter in its half per cent."""
    shape = (200, 400)
    shares = environment.solid_angles(*shape) / (4 * np.pi)
    towards = environment.directions(*shape)
    cap = towards[..., 0] > 0.98
    radiance = np.where(cap, 0.5 / shares[cap].sum(), 0.5 / shares[~cap].sum())
    # Rows of a multiple of 16.
    radiance = np.repeat(np.repeat(radiance, 4, 0), 4, 1)
    assert histograms.measures(radiance, np.eye(3))["brightest"] == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize("kinds", [None, ["photograph"] * 4 + ["sky"] * 5])
def test_the_page_has_all_lights_in_every_panel(kinds, monkeypatch):
    monkeypatch.setattr(histograms, "_COUNT", 37)
    held = suns()
    held.kinds = kinds or held.kinds
    told = []
    figure = histograms.light_histograms(held, lambda *counts: told.append(counts))
    assert told == [(16, 37), (32, 37), (37, 37)]
    assert len(figure.axes) == len(histograms._MEASURES) == 6
    labels = {text.get_text() for text in figure.legends[0].get_texts()}
    assert labels == {f"{4 if kinds else 9} photographed maps", "37 drawn lights"}
    for axes in figure.axes:
        for steps in axes.patches:
            assert np.sum(steps.get_data().values) == pytest.approx(1)


def test_a_bank_without_photographs_shows_its_maps(monkeypatch):
    monkeypatch.setattr(histograms, "_COUNT", 0)
    held = bank(np.ones((2, *SHAPE)), kinds=["room", "sky"])
    (photographed, _), _ = histograms._lights(held, lambda *counts: None)
    assert photographed == "2 maps"
