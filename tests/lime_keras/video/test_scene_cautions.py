"""The warnings of a scene are those of most of its frames."""

import numpy as np
import pytest

from lime_keras.estimate.cautions import NO_OBJECT
from lime_keras.material import Caution, Material
from lime_keras.video.scene_cautions import SceneCautions


def frame(*codes, coverage=0.3, confidence=0.9, words="say"):
    warnings = tuple(Caution(code, f"{words} {code}") for code in codes)
    return Material(mask_coverage=coverage, mask_confidence=confidence, warnings=warnings)


def gathered(*frames):
    scene = SceneCautions()
    for one in frames:
        scene.add(one)
    return scene


def test_a_scene_without_an_object_says_so():
    nothing = Material(mask_coverage=0.0, warnings=(NO_OBJECT,))
    for scene in (gathered(), gathered(nothing, nothing)):
        assert scene.warnings == (NO_OBJECT,) and scene.mask_confidence is None


def test_what_half_of_the_frames_say_is_the_scenes():
    """Frames without an object do not count."""
    nothing = Material(mask_coverage=0.0, warnings=(NO_OBJECT,))
    often = frame("clipped", "too-dark"), frame("clipped", words="at last")
    scene = gathered(*often, nothing, frame(confidence=0.5), frame(confidence=0.7), nothing)
    assert scene.warnings == (Caution("clipped", "in 50% of the frames, at last clipped"),)
    assert scene.mask_confidence == pytest.approx((0.9 + 0.9 + 0.5 + 0.7) / 4)


def test_the_probabilities_are_the_mean_of_the_frames_with_an_object():
    first, second = np.eye(8)[2], np.eye(8)[4]
    scene = SceneCautions()
    assert scene.exponent_bin_probabilities is None
    for coverage, probabilities in ((0.5, first), (0.0, np.eye(8)[7]), (0.5, second), (0.5, None)):
        scene.add(Material(mask_coverage=coverage, exponent_bin_probabilities=probabilities))
    np.testing.assert_allclose(scene.exponent_bin_probabilities, (first + second) / 2)
