"""Draws: their laws, their ranges, their seeds."""

import numpy as np
import pytest
from scipy import stats

from lime_keras.optics import camera_law
from lime_keras.optics.material_law import sample_material
from lime_keras.synthesis import scene_draws

PLAUSIBLE = 1e-3  # p-value, at fixed seeds
SIZE, TEXTURES = 32, (7, 40, 40, 3)


@pytest.fixture(scope="module")
def draws():
    rng = np.random.default_rng(0)
    return scene_draws.batched([scene_draws.draw(rng, SIZE, TEXTURES) for _ in range(3000)])


def uniform(values, low, high):
    return stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > PLAUSIBLE


def test_the_camera_is_drawn_by_its_law(draws):
    assert uniform(np.log2(draws["exposure"]), -camera_law.STOPS, camera_law.STOPS)
    assert uniform(draws["defocus"], 0, 1)
    assert uniform(np.log(draws["full_well"]), *np.log(camera_law.FULL_WELL))
    low, high = camera_law.QUALITY
    quality, counts = np.unique(draws["quality"], return_counts=True)
    np.testing.assert_array_equal(quality, np.arange(low, high + 1))
    assert stats.chisquare(counts[1:-1]).pvalue > PLAUSIBLE
    assert set(np.unique(draws["compressed"])) == {0, 1}
    assert draws["compressed"].mean() == pytest.approx(1 - camera_law.NEVER_COMPRESSED, abs=0.03)
    grain = draws["grain"]
    assert grain.dtype == np.int32 and grain.shape[1] * camera_law.GRAIN_LENGTH == SIZE * SIZE * 3
    assert grain.min() == 0 and grain.max() == camera_law.GRAIN_ROWS - 1


def test_the_material_is_drawn_by_its_law():
    material = sample_material(np.random.default_rng(4))
    draws = scene_draws.draw(np.random.default_rng(4), SIZE, TEXTURES)
    np.testing.assert_allclose(draws["diffuse_albedo"], material.diffuse_albedo, rtol=1e-6)
    assert draws["specular_albedo"] == pytest.approx(material.specular_albedo)
    assert draws["shininess"] == pytest.approx(material.exponent)
    assert draws["ambient"] == pytest.approx(material.ambient)


@pytest.mark.parametrize(
    ("name", "count"), [("turn", 8), ("texture", 7), ("texture_turn", 8), ("corner", 9)]
)
def test_every_choice_is_as_likely(draws, name, count):
    assert draws[name].dtype == np.int32
    for values in draws[name].reshape(len(draws[name]), -1).T:
        counts = np.bincount(values)
        assert len(counts) == count and stats.chisquare(counts).pvalue > PLAUSIBLE


def test_some_backgrounds_are_blended_and_some_are_surroundings(draws):
    blended = draws["blend"].reshape(len(draws["blend"]), -1).max(axis=1) > -100
    assert blended.mean() == pytest.approx(scene_draws.BLENDED, abs=0.03)
    assert draws["surrounded"].mean() == pytest.approx(scene_draws.SURROUNDED, abs=0.03)
    assert uniform(draws["sharpness"], 0, 1)
    rooms = draws["surrounded"] == 1
    levels = np.log2(draws["tint"]).mean(axis=2)
    assert abs(levels[rooms, 0].mean()) < 0.1 and levels[rooms, 0].std() > 0.5
    assert levels[~rooms].std() < 0.4 and 0.2 < draws["tint"].min() < draws["tint"].max() < 5


def test_a_scene_is_a_function_of_the_generator():
    first, again, other = (
        scene_draws.draw(np.random.default_rng(k), SIZE, TEXTURES) for k in (0, 0, 1)
    )
    for name, value in first.items():
        assert value.dtype in (np.float32, np.int32), name
        np.testing.assert_array_equal(again[name], value)
    assert not np.array_equal(other["grain"], first["grain"])


@pytest.mark.parametrize("textures", [(0, 64, 64, 3), (4, 31, 31, 3)])
def test_textures_that_are_missing_or_too_small_are_refused(textures):
    with pytest.raises(ValueError, match="backgrounds of 32×32 pixels cannot be cut"):
        scene_draws.draw(np.random.default_rng(0), SIZE, textures)


def test_textures_of_the_images_size_are_enough():
    draws = scene_draws.draw(np.random.default_rng(0), SIZE, (1, SIZE, SIZE, 3))
    assert not draws["texture"].any() and not draws["corner"].any()


def test_materials_follow_any_of_the_laws_asked_for():
    def specular(*laws):
        rng = np.random.default_rng(2)
        return [scene_draws.draw(rng, SIZE, TEXTURES, laws)["specular_albedo"] for _ in range(400)]

    dull = np.mean(np.array(specular("natural")) < 0.15)
    both = np.mean(np.array(specular("uniform", "natural")) < 0.15)
    assert dull > 0.75
    assert both == pytest.approx((dull + 0.15) / 2, abs=0.08)
