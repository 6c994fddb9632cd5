"""A stream of frames: the numbers of the estimator, fused; the light of section 7."""

import json

import numpy as np
import pytest
from live_scenes import ball

from lime_keras import Estimator
from lime_keras.lighting import guessed_light
from lime_keras.live.session import Session, Wanted
from lime_keras.optics import environment
from lime_keras.video.tracking import LOST_AFTER


@pytest.fixture(scope="module")
def estimator():
    return Estimator("live")


FRAME = ball()


def test_one_frame_is_the_estimate_of_a_photo(estimator):
    answer = Session(estimator).answer(FRAME, None, Wanted(fusion=False))
    expected = estimator.estimate(FRAME)
    numbers, told = answer.numbers, expected.to_json()
    assert numbers["found"] and not numbers["cut"] and numbers["fused"] is None
    assert numbers["material"]["diffuse_albedo"] == pytest.approx(told["diffuse_albedo"], rel=1e-4)
    assert numbers["material"]["specular_albedo"] == pytest.approx(
        told["specular_albedo"], rel=1e-4
    )
    assert numbers["material"]["exponent"] == pytest.approx(told["exponent"], rel=1e-4)
    assert tuple(numbers["square"]) == expected.square
    assert numbers["mask_coverage"] == pytest.approx(expected.mask_coverage, abs=0.01)
    assert numbers["mask_confidence"] == pytest.approx(told["mask_confidence"], abs=1e-4)
    assert {name: array.shape for name, array in answer.arrays.items()} == {
        "mask": (128, 128),
        "specular_shading": (128, 128),
        "mirror": (128, 128),
        "light": (64, 128),
    }
    for name in ("specular_shading", "mirror", "light"):
        assert answer.arrays[name].dtype == np.float32 and np.isfinite(answer.arrays[name]).all()
    assert set(numbers["ms"]) == {"framing_and_mask", "material", "light", "total"}
    json.dumps(numbers, allow_nan=False)


def test_the_light_is_that_of_the_photo_in_the_squares_own_pixels(estimator):
    """The same evidence on another grid: nearly the same light."""
    found = Session(estimator).answer(FRAME, None, Wanted(fusion=False)).arrays["light"]
    material = estimator.estimate(FRAME)
    expected = guessed_light.estimate(FRAME / np.float32(255), material)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.2)
    places = [np.unravel_index(light.argmax(), light.shape) for light in (found, expected)]
    first, second = (environment.directions(64, 128)[place] for place in places)
    assert first @ second > np.cos(np.radians(20))


def test_the_warnings_are_those_of_the_photo(estimator):
    corner = np.zeros(FRAME.shape[:2], np.uint8)
    corner[:50, :60] = 255
    answer = Session(estimator).answer(FRAME // 8, corner, Wanted(light=False))
    expected = estimator.estimate(FRAME // 8, corner).to_json()["warnings"]
    assert answer.numbers["warnings"] == expected
    assert {warning["code"] for warning in expected} >= {"few-pixels", "touches-frame", "too-dark"}
    assert answer.numbers["mask_confidence"] is None


def test_only_what_is_wanted_is_estimated(estimator):
    answer = Session(estimator).answer(FRAME, None, Wanted(material=False, light=True))
    assert list(answer.arrays) == ["mask"] and answer.numbers["material"] is None
    assert set(answer.numbers["ms"]) == {"framing_and_mask", "total"}
    answer = Session(estimator).answer(FRAME, None, Wanted(light=False))
    assert "light" not in answer.arrays and answer.numbers["material"]


def test_a_painted_mask_is_taken(estimator):
    mask = np.zeros(FRAME.shape[:2], np.uint8)
    mask[40:90, 50:110] = 255
    answer = Session(estimator).answer(FRAME, mask, Wanted(light=False))
    share = 50 * 60 / mask.size
    assert answer.numbers["mask_coverage"] == pytest.approx(share, rel=0.05)
    empty = Session(estimator).answer(FRAME, np.zeros_like(mask), Wanted())
    assert not empty.numbers["found"] and empty.numbers["material"] is None
    assert [warning["code"] for warning in empty.numbers["warnings"]] == ["no-object"]


def test_material_and_light_are_fused_until_a_cut(estimator):
    session, other = Session(estimator), ball(radius=0.55, colour=(0.1, 0.2, 0.7))
    first = session.answer(FRAME, None, Wanted())
    fused = session.answer(other, None, Wanted())
    alone = Session(estimator).answer(other, None, Wanted())
    assert not fused.numbers["cut"]
    low, high = sorted(answer.numbers["material"]["diffuse_albedo"][2] for answer in (first, alone))
    assert low < fused.numbers["fused"]["diffuse_albedo"][2] < high
    assert not np.array_equal(fused.arrays["light"], alone.arrays["light"])
    scene = 255 - FRAME
    answer = session.answer(scene, None, Wanted())
    assert answer.numbers["cut"]
    if answer.numbers["found"]:
        again = Session(estimator).answer(scene, None, Wanted())
        assert answer.numbers["fused"] == again.numbers["fused"]
        assert np.array_equal(answer.arrays["light"], again.arrays["light"])


def test_a_frame_of_the_mask_alone_keeps_what_was_fused(estimator):
    session = Session(estimator)
    first = session.answer(FRAME, None, Wanted(light=False))
    second = session.answer(FRAME, None, Wanted(material=False))
    assert second.numbers["fused"] == first.numbers["fused"]


def test_a_lost_object_and_a_restart_forget(estimator):
    nothing = np.zeros(FRAME.shape[:2], np.uint8)
    session = Session(estimator)
    session.answer(FRAME, None, Wanted(light=False))
    for _ in range(LOST_AFTER):
        assert session.answer(FRAME, nothing, Wanted()).numbers["fused"]
    assert session.answer(FRAME, nothing, Wanted()).numbers["fused"] is None
    session.answer(FRAME, None, Wanted(light=False))
    session.restart()
    assert session.answer(FRAME, nothing, Wanted()).numbers["fused"] is None


@pytest.mark.parametrize("level", [0, 255])
@pytest.mark.parametrize("shape", [(1, 1), (16, 500)])
def test_frames_without_anything_are_answers(level, shape, estimator):
    image = np.full((*shape, 3), level, np.uint8)
    for mask in (None, np.full(shape, 255, np.uint8)):
        answer = Session(estimator).answer(image, mask, Wanted())
        json.dumps(answer.numbers, allow_nan=False)
        assert all(np.isfinite(array).all() for array in answer.arrays.values())
