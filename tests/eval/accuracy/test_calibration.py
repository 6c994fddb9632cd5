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
    count, confidence, share = calibration.reliability(probabilities, right)
    assert count.tolist() == [0, 0, 0, 1, 0, 1, 0, 0, 0, 2]
    assert confidence[[3, 5, 9]] == pytest.approx([0.35, 0.55, 0.95])
    assert share[[3, 5, 9]] == pytest.approx([0.0, 1.0, 0.5])
    assert np.isnan(share[0]) and np.isnan(confidence[0])


def test_honest_answers_are_calibrated_and_boasting_ones_are_not():
    rng = np.random.default_rng(0)
    confidence = rng.uniform(0.2, 1.0, 200_000)
    right = rng.uniform(size=confidence.size) < confidence
    assert _error(_answers(confidence), right) < 0.005
    assert _error(_answers(confidence), rng.uniform(size=confidence.size) < 0.125) > 0.4


def test_the_curve_is_scikit_learns():
    rng = np.random.default_rng(1)
    confidence = rng.uniform(0.13, 1.0, 5000)
    right = rng.uniform(size=confidence.size) < confidence**2
    share, mean = calibration_curve(right, confidence, n_bins=calibration.BINS)
    counts, means, shares = calibration.reliability(_answers(confidence), right)
    filled = counts > 0
    assert shares[filled] == pytest.approx(share)
    assert means[filled] == pytest.approx(mean)


def test_certainty_is_in_the_last_bin():
    probabilities = np.eye(8)[[3, 4]]
    counts = calibration.reliability(probabilities, np.array([True, True]))[0]
    assert counts.tolist() == [0] * (calibration.BINS - 1) + [2]
    assert _error(probabilities, np.array([True, True])) == 0


@given(st.lists(st.tuples(st.floats(0.125, 1.0), st.booleans()), min_size=1, max_size=30))
def test_the_error_is_a_share_and_each_example_is_counted_once(answers):
    confidence, right = map(np.array, zip(*answers, strict=True))
    error = _error(_answers(confidence), right)
    assert 0 <= error <= 1
    assert calibration.reliability(_answers(confidence), right)[0].sum() == len(answers)
