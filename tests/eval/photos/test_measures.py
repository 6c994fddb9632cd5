"""The measures on photos, against slow references and at their extremes."""

import itertools

import numpy as np
import pytest
from sklearn.metrics import roc_auc_score

from lime_keras.eval.photos import measures
from lime_keras.optics import colour, shading

RNG = np.random.default_rng(5)
NAN = np.nan


def test_the_gloss_order_is_the_area_under_the_roc_curve():
    for ties in (3, 1000):
        score, glossy = RNG.integers(ties, size=40) / 1.0, RNG.random(40) < 0.4
        expected = roc_auc_score(glossy, score)
        assert measures.gloss_order(score, glossy) == pytest.approx(expected)
        assert measures.gloss_order(np.exp(score / ties), glossy) == pytest.approx(expected)
        assert measures.gloss_order(-score, glossy) == pytest.approx(1 - expected)


@pytest.mark.parametrize(
    ("score", "glossy", "expected"),
    [
        ([], [], NAN),
        ([1.0], [True], NAN),
        ([1.0, 2.0], [True, True], NAN),
        ([1.0, 2.0], [False, False], NAN),
        ([2.0, 1.0], [True, False], 1.0),
        ([1.0, 1.0], [True, False], 0.5),
        ([NAN, 1.0], [True, False], 0.5),
        ([NAN, NAN], [True, False], 0.5),
        ([np.inf, -np.inf], [True, False], 1.0),
        ([np.inf, np.inf], [True, False], 0.5),
        # NaN is a tie with both matte photos: (½ + ½ + 1 + 1) / 4.
        ([NAN, 5.0, 1.0, 2.0], [True, True, False, False], 0.75),
    ],
)
def test_the_gloss_order_at_its_extremes(score, glossy, expected):
    found = measures.gloss_order(np.array(score), np.array(glossy, bool))
    assert found == pytest.approx(expected, nan_ok=True)


def test_in_pairs_only_photos_of_one_name_are_compared():
    score, glossy = RNG.integers(5, size=30) / 1.0, RNG.random(30) < 0.5
    pair = RNG.choice([None, "", "a", "b", "c"], 30)
    right = [
        (score[i] > score[j]) + (score[i] == score[j]) / 2
        for i, j in itertools.product(range(30), repeat=2)
        if glossy[i] and not glossy[j] and pair[i] and pair[i] == pair[j]
    ]
    assert measures.gloss_order(score, glossy, pair) == pytest.approx(np.mean(right))
    assert np.isnan(measures.gloss_order(score, glossy, [None] * 30))
    assert measures.gloss_order(score, glossy, ["a"] * 30) == measures.gloss_order(score, glossy)


def test_bootstrap_samples_of_the_gloss_order_draw_photos_of_each_finish():
    score, glossy = RNG.normal(size=24) + np.repeat([1.0, 0.0], 12), np.repeat([True, False], 12)
    samples = measures.gloss_order_samples(score, glossy)
    # The same draws, one by one: a photo drawn twice counts twice.
    rng = np.random.default_rng(measures._SEED)
    drawn = [rng.multinomial(12, np.full(12, 1 / 12), size=1000) for _ in range(2)]
    for row in (0, 999):
        index = np.repeat(np.arange(24), np.concatenate([part[row] for part in drawn]))
        assert samples[row] == pytest.approx(roc_auc_score(glossy[index], score[index]))
    assert samples.mean() == pytest.approx(measures.gloss_order(score, glossy), abs=0.02)
    low, high = measures.interval(samples)
    assert low < measures.gloss_order(score, glossy) < high
    assert np.array_equal(samples, measures.gloss_order_samples(score, glossy))
    assert np.all(measures.gloss_order_samples(1.0 * glossy, glossy) == 1)
    assert np.all(measures.gloss_order_samples(np.full(24, NAN), glossy) == 0.5)


def test_one_photo_of_a_finish_has_no_interval():
    glossy = np.array([True, False, False])
    for counted in (glossy, ~glossy, glossy[1:], glossy[:0]):
        samples = measures.gloss_order_samples(np.arange(len(counted)) / 1.0, counted)
        assert samples.shape == (1000,) and measures.interval(samples) is None


def test_pairs_that_a_sample_does_not_hold_do_not_count():
    score, glossy = np.array([2.0, 0, 1, 3]), np.array([True, True, False, False])
    samples = measures.gloss_order_samples(score, glossy, ["a", "b", "a", "b"])
    assert set(samples[~np.isnan(samples)]) == {0, 0.5, 1}
    assert 0 < np.isnan(samples).sum() < 1000 and measures.interval(samples) == (0, 1)


def test_a_dielectric_reflects_in_a_furnace_what_fresnel_says():
    """At n = o; and the m_s that fits a whole smooth sphere is within a factor of 2 of that."""
    index = measures.DIELECTRIC_INDEX
    expected = measures.dielectric_specular_albedo()
    assert expected == pytest.approx(0.04)
    assert measures.dielectric_specular_albedo(1.0) == 0

    radiance = np.ones((64, 128))
    up = np.array([[0.0, 0.0, 1.0]])
    for exponent in (1.0, 30.0):
        shade = shading.specular(up, up, exponent, *shading.texels(radiance))
        assert expected * shade == pytest.approx(expected, rel=0.01)

    # Pixels of a sphere from afar: cos² is uniform. As s grows, S in a furnace becomes the cosine.
    cosine = np.sqrt((np.arange(4000) + 0.5) / 4000)
    g = np.sqrt(index**2 - 1 + cosine**2)
    fresnel = ((g - cosine) / (g + cosine)) ** 2 / 2
    fresnel *= 1 + ((cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)) ** 2
    assert fresnel[-1] == pytest.approx(expected, rel=1e-3)
    fitted = fresnel @ cosine / (cosine @ cosine)
    assert fitted == pytest.approx(0.084, abs=5e-4)


def test_the_lobes_peak_is_the_radiance_of_a_lights_mirror_image():
    up, energy = np.array([[0.0, 0.0, 1.0]]), np.ones(1)
    for exponent in (0.0, 1.0, 30.0, 1000.0):
        seen = 0.3 * shading.specular(up, up, exponent, up, energy)
        assert measures.lobe_peak(0.3, exponent) == pytest.approx(seen[0])
    # A gloss meter's receptor, 4.4° wide, lies inside the sharpest lobe.
    assert np.degrees(4 * np.arccos(0.5 ** (1 / 1000))) == pytest.approx(8.5, abs=0.05)
    assert measures.lobe_peak(0.0, 500.0) == 0
    found = measures.lobe_peak(np.array([NAN, 0.5]), np.array([3.0, NAN]))
    assert np.isnan(found).all()


def test_ratios_of_the_specular_albedo():
    found = measures.specular_ratio(np.array([0.04, 0.4, 0.02, 0.0, NAN]))
    np.testing.assert_allclose(found, [1, 10, 0.5, 0.025, NAN])
    within = measures.within_factor_of_2(
        np.array([0.5, 0.499, 1.0, 2.0, 2.001, 0.025, NAN, np.inf])
    )
    assert within.tolist() == [True, False, True, True, False, False, False, False]


def test_the_mean_colour_is_of_the_objects_unclipped_pixels():
    image = np.zeros((2, 3, 3), np.float32)
    image[0] = [[0.2, 0.4, 0.6], [0.6, 0.4, 0.2], [1.0, 0.4, 0.2]]
    mask = np.zeros((2, 3, 1), np.float32)
    mask[0] = 0.5
    expected = colour.srgb_to_linear(image[0, :2].astype(float)).mean(0)
    np.testing.assert_allclose(measures.mean_colour(image, mask), expected, rtol=1e-6)
    assert np.isnan(measures.mean_colour(image, mask * 0.9)).all()
    assert np.isnan(measures.mean_colour(np.ones((2, 3, 3), np.float32), mask)).all()


def test_angles_between_colours():
    red, green = np.eye(3)[:2]
    assert measures.angle(red, green) == pytest.approx(90)
    assert measures.angle(red, red + green) == pytest.approx(45)
    assert measures.angle(1e-30 * red, 1e30 * red) == 0
    # Where an arc cosine of the dot product loses all digits.
    assert measures.angle(red, red + 1e-9 * green) == pytest.approx(np.degrees(1e-9))
    for black in (np.zeros(3), np.full(3, NAN), np.array([np.inf, 0, 0])):
        assert np.isnan(measures.angle(red, black)) and np.isnan(measures.angle(black, red))
        assert np.isnan(measures.unexplained_angle(red, black))
        assert np.isnan(measures.unexplained_angle(black, red))


def test_the_unexplained_angle_is_the_least_over_all_amounts_of_grey():
    albedo, pixels = RNG.uniform(0.01, 1, (2, 200, 3))
    found = measures.unexplained_angle(albedo, pixels)
    shares = np.linspace(0, 1, 2001)[:, None, None]
    allowed = pixels - shares * pixels.min(-1, keepdims=True)
    slow = measures.angle(allowed, albedo).min(0)
    np.testing.assert_allclose(found, slow, atol=0.03)
    assert np.all(found <= measures.angle(albedo, pixels) + 1e-9)
    # All three cases occur: the nearest colour is inside the arc, or one of its ends.
    assert 20 < np.sum(found < measures.angle(albedo, pixels) - 0.1) < 180


@pytest.mark.parametrize("gloss", [0.0, 0.3, 5.0])
def test_a_right_answer_has_no_unexplained_angle_whatever_its_gloss(gloss):
    m_d = RNG.uniform(0.05, 1, (50, 3))
    pixels = 0.7 * m_d + gloss
    assert measures.unexplained_angle(m_d, pixels).max() < 1e-4
    if gloss:
        assert measures.angle(m_d, pixels).max() > 1


def test_grey_answers_and_grey_pixels():
    grey, pixels = np.ones(3), np.array([0.3, 0.2, 0.1])
    expected = measures.angle(grey, pixels)
    assert measures.unexplained_angle(grey, pixels) == pytest.approx(expected)
    assert measures.unexplained_angle(pixels, grey) == pytest.approx(expected)
    assert measures.unexplained_angle(grey, grey) == pytest.approx(0, abs=1e-6)


def test_the_other_photos_colours():
    colours = np.array([[1.0, 0, 0], [0, 1, 0], [1, 1, 0], [NAN] * 3])
    found = measures.others(colours)
    np.testing.assert_allclose(found, [(90 + 45) / 2, (90 + 45) / 2, 45, NAN])
    assert np.isnan(measures.others(colours[:1])).all()
    assert measures.others(colours[:0]).shape == (0,)


def test_the_overlap_of_masks():
    one, other = (np.array(m, np.float32)[..., None] for m in ([[1, 0.5, 0]], [[0, 0.5, 0.49]]))
    assert measures.overlap(one, other) == 0.5
    assert measures.overlap(one * 0, other * 0) == 1
    assert measures.overlap(one, other * 0) == 0
    assert measures.overlap(one, np.full_like(one, NAN)) == 0


def test_means_leave_out_what_is_not_known():
    values = np.array([1.0, NAN, 3.0])
    assert measures.mean(values) == 2
    samples = measures.mean_samples(values)
    assert samples.shape == (1000,) and measures.interval(samples) == (1, 3)
    assert np.isnan(samples).sum() == pytest.approx(1000 / 27, abs=25), "all three drawn are NaN"
    for few in (np.array([]), np.array([NAN, NAN]), np.array([5.0]), np.array([5.0, NAN])):
        assert measures.interval(measures.mean_samples(few)) is None
    assert np.isnan(measures.mean(np.array([NAN]))) and np.isnan(measures.mean(np.array([])))


def test_the_interval_of_a_mean_is_that_of_the_normal_law():
    values = RNG.normal(size=400)
    low, high = measures.interval(measures.mean_samples(values))
    assert (high - low) / 2 == pytest.approx(1.96 * values.std() / 20, rel=0.1)
