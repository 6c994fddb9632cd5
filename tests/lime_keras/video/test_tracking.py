"""What is fused, held and forgotten from frame to frame."""

import numpy as np
import pytest
from clips import NOTHING, material

from lime_keras.material import Material
from lime_keras.optics import gloss
from lime_keras.video.fusion import Fusion
from lime_keras.video.tracking import LOST_AFTER, Tracker, material_of, parameters

STILL = np.full((8, 8, 3), 128, np.uint8)


def test_parameters_and_back():
    one = material(0)
    values = parameters(one)
    np.testing.assert_array_equal(values[:4], [*one.diffuse_albedo, one.specular_albedo])
    assert values[4] == np.log10(one.exponent)
    back = material_of(values, gloss.DEFAULT)
    np.testing.assert_allclose(back.diffuse_albedo, one.diffuse_albedo, rtol=1e-6)
    assert back.specular_albedo == one.specular_albedo
    assert back.exponent == pytest.approx(one.exponent, rel=1e-12)


def test_what_was_not_found_or_not_asked_for_is_nan():
    assert np.isnan(parameters(NOTHING)).all()
    only_albedo = Material(np.ones(3), 0.5, mask_coverage=0.1)
    np.testing.assert_array_equal(parameters(only_albedo), [1, 1, 1, 0.5, np.nan])
    assert material_of(parameters(only_albedo), gloss.DEFAULT).exponent is None
    nothing = material_of(np.full(5, np.nan), gloss.DEFAULT)
    assert nothing.to_json() == {"warnings": []}


def test_estimates_are_fused_and_held_while_the_object_is_lost():
    tracker, fusion, expected = Tracker(), Fusion(), None
    for number in range(12):
        found = number % 3 != 2
        one = material(number) if found else NOTHING
        step = tracker.step(STILL, one)
        expected = fusion.update(parameters(one)) if found else expected
        assert (step.found, step.cut) == (found, False)
        np.testing.assert_array_equal(step.fused, expected)
        np.testing.assert_array_equal(step.estimate, parameters(one))


@pytest.mark.parametrize(("lost", "held"), [(LOST_AFTER, True), (LOST_AFTER + 1, False)])
def test_an_object_lost_for_long_is_forgotten(lost, held):
    tracker = Tracker()
    for number in range(6):
        before = tracker.step(STILL, material(number))
    for _ in range(lost):
        last = tracker.step(STILL, NOTHING)
    expected = before.fused if held else np.full(5, np.nan)
    np.testing.assert_array_equal(last.fused, expected)
    again = tracker.step(STILL, material(99))
    assert np.array_equal(again.fused, parameters(material(99))) != held


def test_a_cut_restarts():
    tracker = Tracker()
    for number in range(6):
        tracker.step(STILL, material(number))
    step = tracker.step(STILL // 4, material(7))
    assert step.cut
    np.testing.assert_array_equal(step.fused, parameters(material(7)))
    tracker.step(STILL // 4, material(8))
    # A cut to a scene without an object forgets as well.
    step = tracker.step(STILL, NOTHING)
    assert step.cut and np.isnan(step.fused).all()
