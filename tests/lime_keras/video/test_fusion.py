"""Eq. 6 and its median, next to a slow reference, and at the extremes."""

import warnings

import numpy as np
import pytest

from lime_keras.video.fusion import Fusion, decayed


def slow(estimates):
    """Section 5.5 for one number, NaN left out, in plain Python."""
    seen = [x for x in estimates if not np.isnan(x)]
    medians = [np.median(seen[max(0, k - 4) : k + 1]) for k in range(len(seen))]
    return np.mean(medians) if seen else np.nan


def run(estimates):
    fusion = Fusion()
    return [fusion.update(estimate) for estimate in estimates]


@pytest.mark.parametrize("shape", [(), (1,), (3,), (4, 8, 1)])
@pytest.mark.parametrize("unseen", [0.0, 0.4])
def test_every_element_is_fused_as_the_paper_says(shape, unseen):
    rng = np.random.default_rng(0)
    estimates = rng.normal(size=(23, *shape))
    estimates[rng.uniform(size=estimates.shape) < unseen] = np.nan
    for t, fused in enumerate(run(estimates), start=1):
        assert fused.shape == shape and fused.dtype == np.float64
        expected = np.apply_along_axis(slow, 0, estimates[:t])
        np.testing.assert_allclose(fused, expected, rtol=1e-13)


def test_the_first_frames_by_hand():
    fused = run([1.0, 3.0, 8.0, 0.0, 9.0, 2.0])
    # Medians: 1, 2, 3, 2, 3 and, without the first frame, 3.
    np.testing.assert_allclose(fused, np.cumsum([1, 2, 3, 2, 3, 3]) / np.arange(1, 7))


def test_one_frame_is_its_own_fusion():
    estimate = np.array([0.25, np.nan, -3.0])
    np.testing.assert_array_equal(Fusion().update(estimate), estimate)


def test_a_texel_that_goes_out_of_sight_keeps_its_value():
    views = np.array([[1.0, np.nan], [2.0, np.nan], [np.nan, np.nan], [np.nan, 6.0], [3.0, 8.0]])
    fused = np.array(run(views))
    np.testing.assert_array_equal(fused[:, 0], [1, 1.25, 1.25, 1.25, 1.5])
    np.testing.assert_array_equal(fused[:, 1], [np.nan, np.nan, np.nan, 6, 6.5])


def test_what_is_handed_out_is_not_the_memory():
    fusion, estimate = Fusion(), np.array([1.0, 2.0])
    fusion.update(estimate)[:] = 100
    estimate[:] = 100
    np.testing.assert_array_equal(fusion.update(np.full(2, np.nan)), [1, 2])


def test_a_million_frames():
    """Constant estimates stay to the last digit; others have their exact mean."""
    fusion = Fusion()
    constant = np.array([0.1, 1 / 3, 1e-30, 1e30, -0.0])
    for _ in range(20_000):
        fused = fusion.update(constant)
    np.testing.assert_array_equal(fused, constant)
    average, total = 0.0, 1_000_000
    for t in range(1, total + 1):
        average = decayed(average, 1000.0 + (t % 2), t)
    assert average == pytest.approx(1000.5, rel=1e-12)
    assert decayed(average, average + 1.0, total) - average == pytest.approx(1 / total, rel=1e-6)


def test_nothing_is_warned_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(np.full((9, 2, 2), np.nan))
        run([1e308, 1e308, 1e308])


@pytest.mark.parametrize("value", [np.inf, -np.inf])
def test_an_infinite_estimate_is_refused_and_leaves_no_trace(value):
    fusion = Fusion()
    fusion.update(np.ones(3))
    with pytest.raises(ValueError, match="1 of 3 elements are infinite: pass them as NaN"):
        fusion.update(np.array([1.0, value, 1.0]))
    np.testing.assert_array_equal(fusion.update(np.full(3, 3.0)), np.full(3, 1.5))


def test_another_shape_is_refused():
    fusion = Fusion()
    fusion.update(np.ones(3))
    with pytest.raises(ValueError, match="dimension"):
        fusion.update(np.ones((1, 3)))
