"""Calibration against hand arithmetic and scikit-learn."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.calibration import calibration_curve

from lime_keras.eval.accuracy import calibration


def _answers(confidence):
    """Eight probabilities each, the winning one of that size."""
    confidence = np.asarray(confidence, np.float64)
    rest = (1 - confidence) / 7
    return np.concatenate([confidence[:, None], np.repeat(rest[:, None], 7, axis=1)], axis=1)


def _error(probabilities, right):
    return sum(abs(np.mean(gap)) for gap in calibration.gaps(probabilities, right).values())


def test_four_answers_by_hand():
    probabilities = _answers([0.95, 0.95, 0.55, 0.35])
    right = np.array([True, False, True, False])
    # (2·|0.95 − 0.5| + |0.55 − 1| + |0.35 − 0|) / 4
    assert _error(probabilities, right) == pytest.approx((0.9 + 0.45 + 0.35) / 4)


def test_honest_answers_are_calibrated_and_boasting_ones_are_not():
    rng = np.random.default_rng(0)
    confidence = rng.uniform(0.2, 1.0, 200_000)
    right = rng.uniform(size=confidence.size) < confidence
    assert _error(_answers(confidence), right) < 0.005
    assert _error(_answers(confidence), rng.uniform(size=confidence.size) < 0.125) > 0.4


def test_the_error_is_that_of_scikit_learns_curve():
    rng = np.random.default_rng(1)
    confidence = rng.uniform(0.13, 1.0, 5000)
    right = rng.uniform(size=confidence.size) < confidence**2
    share, mean = calibration_curve(right, confidence, n_bins=calibration.BINS)
    counts = np.histogram(confidence, calibration.BINS, (0, 1))[0]
    expected = np.sum(counts[counts > 0] * np.abs(mean - share)) / len(right)
    assert _error(_answers(confidence), right) == pytest.approx(expected)


def test_certainty_is_in_the_last_bin():
    probabilities = np.eye(8)[[3, 4]]
    assert _error(probabilities, np.array([True, True])) == 0
    wrong = calibration.gaps(probabilities, np.array([False, False]))
    assert wrong["calibration_9"].tolist() == [1, 1]


@given(st.lists(st.tuples(st.floats(0.125, 1.0), st.booleans()), min_size=1, max_size=30))
def test_the_error_is_a_share(answers):
    confidence, right = map(np.array, zip(*answers, strict=True))
    assert 0 <= _error(_answers(confidence), right) <= 1
