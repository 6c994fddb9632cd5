"""The double-precision system is Keras' own, but for rounding, whose size it can foretell."""

import numpy as np

from lime_keras.eval.stability import double_precision
from lime_keras.eval.stability.double_precision import EXACT, Rounding
from lime_keras.export import parity
from lime_keras.model import weights
from lime_keras.networks import assemble


def compared(folder):
    """Keras' answers, ours, and the subnetworks, for the export's own images."""
    architecture, subnetworks = weights.load(folder)
    images = parity.images(architecture.size)
    return assemble(subnetworks)(images), double_precision.answers(subnetworks, images), subnetworks


def test_it_answers_as_keras_does(tiny_model):
    expected, found, _ = compared(tiny_model)
    check(expected, found)


def test_it_answers_as_keras_does_for_ablations(ablation_model):
    expected, found, _ = compared(ablation_model)
    check(expected, found)


def check(expected, found):
    assert set(found) == set(expected)
    for name, value in found.items():
        assert value.dtype == np.float64
        np.testing.assert_allclose(value, expected[name], rtol=1e-4, atol=1e-5, err_msg=name)
        if value.ndim == 4:
            assert np.ptp(value) > 1e-3, f"{name} says nothing"


def test_it_computes_in_double_precision(tiny_model):
    _, found, subnetworks = compared(tiny_model)
    images = parity.images(32).astype(np.float64)
    nearly = double_precision.answers(subnetworks, images + 1e-12 * (images < 0.5))
    moved = max(np.abs(nearly[name] - found[name]).max() for name in found)
    assert 0 < moved < 1e-9


def test_rounding_moves_answers_in_proportion(tiny_model):
    _, found, subnetworks = compared(tiny_model)
    moved = []
    for epsilon in (1e-9, 1e-6, 1e-3):
        rounding = Rounding(epsilon, np.random.default_rng(0))
        draw = double_precision.answers(subnetworks, parity.images(32), rounding)
        moved.append(max(np.abs(draw[name] - found[name]).max() for name in found))
    assert 300 < moved[1] / moved[0] < 3000 and 100 < moved[2] / moved[1] < 3000
    again = double_precision.answers(subnetworks, parity.images(32), EXACT)
    assert all((again[name] == found[name]).all() for name in found)
