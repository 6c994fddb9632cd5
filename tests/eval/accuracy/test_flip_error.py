"""ꟻLIP of layers: identity, order, cutting out, extremes."""

import numpy as np
import pytest

from lime_keras.eval.accuracy.flip_error import layer_flip


@pytest.fixture(scope="module")
def layer():
    """A smooth layer with one bright spot, `(64, 64, 1)`."""
    y, x = np.mgrid[:64, :64] / 63
    return (0.4 + 0.3 * x + 5 * np.exp(-200 * ((x - 0.4) ** 2 + (y - 0.5) ** 2)))[..., None].astype(
        np.float32
    )


@pytest.fixture(scope="module")
def mask():
    y, x = np.mgrid[:64, :64] - 31.5
    return (np.hypot(x, y) < 25).astype(np.float32)[..., None]


def test_the_truth_differs_in_nothing(layer, mask):
    assert layer_flip(layer, layer, mask) == 0


def test_the_further_off_the_worse_and_never_above_one(layer, mask):
    errors = [layer_flip(layer, layer * factor, mask) for factor in (0.9, 0.7, 0.4, 0.0)]
    assert errors == sorted(errors)
    assert 0 < errors[0] and errors[-1] <= 1
    # An object that is white throughout and found black is as wrong as can be.
    white = np.ones_like(layer)
    assert layer_flip(white, 0 * white, np.ones_like(mask)) > 0.9


def test_what_lies_outside_the_mask_does_not_count(layer, mask):
    assert layer_flip(layer, np.where(mask > 0, layer, 1e4), mask) == 0


def test_only_the_scale_of_both_together_is_free(layer, mask):
    half = layer_flip(layer, layer * 0.5, mask)
    assert layer_flip(layer * 40, layer * 20, mask) == pytest.approx(half, rel=1e-3)


@pytest.mark.parametrize("strength", [0.0, 1e-8, 65504.0])
def test_extremes_stay_finite(layer, mask, strength):
    found = layer_flip(layer * strength, layer, mask)
    assert 0 <= found <= 1


def test_no_object_no_difference(layer, mask):
    assert layer_flip(layer, layer * 0, mask * 0) == 0
