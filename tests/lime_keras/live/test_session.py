"""A stream of frames: the numbers of the estimator, fused; the light of section 7."""

import json

import numpy as np
import pytest
from live_scenes import ball

from lime_keras import Estimator
from lime_keras.estimate import framing
from lime_keras.lighting import guessed_light
from lime_keras.live.session import FrameRequest, Session
from lime_keras.optics import environment, shading
from lime_keras.video.tracking import LOST_AFTER


@pytest.fixture(scope="module")
def estimator():
    return Estimator("live")


FRAME = ball()


def test_one_frame_is_the_estimate_of_a_photo(estimator):
    answer = Session(estimator).process(FRAME, None, FrameRequest(fusion=False))
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
    found = Session(estimator).process(FRAME, None, FrameRequest(fusion=False)).arrays["light"]
    material = estimator.estimate(FRAME)
    expected = guessed_light.estimate(FRAME / np.float32(255), material)
    assert found.mean() == pytest.approx(expected.mean(), rel=0.2)
    places = [np.unravel_index(light.argmax(), light.shape) for light in (found, expected)]
    first, second = (environment.directions(64, 128)[place] for place in places)
    assert first @ second > np.cos(np.radians(20))


def test_a_light_that_is_not_found_is_a_warning(estimator, monkeypatch):
    def fail(*_):
        raise ValueError("nothing is lit")

    monkeypatch.setattr(guessed_light, "estimate", fail)
    answer = Session(estimator).process(FRAME, None, FrameRequest(fusion=False))
    assert "light" not in answer.arrays and answer.numbers["material"]
    told = {one["code"]: one["message"] for one in answer.numbers["warnings"]}
    assert told["no-light"] == "no light was found: nothing is lit"


def test_a_pixel_of_the_square_looks_where_the_frames_pixel_looks(estimator, monkeypatch):
    seen = []

    def estimate(image, material, camera):
        seen.append((len(image), camera))
        return np.zeros((64, 128, 3), np.float32)

    monkeypatch.setattr(guessed_light, "estimate", estimate)
    frame = ball(480, 640, radius=0.25, place=(0.8, -0.2))
    answer = Session(estimator).process(frame, None, FrameRequest(fusion=False))
    top, left, side = answer.numbers["square"]
    assert left > 0 and top != 0
    ((size, small),), whole = seen, shading.assumed_camera(480, 640)
    for first, begin in ((0, left), (1, top)):
        in_square = (size / 4 - small[2 + first]) / small[first]
        in_frame = (begin + side / 4 - whole[2 + first]) / whole[first]
        assert in_square == pytest.approx(in_frame, rel=1e-6)


def test_the_warnings_are_those_of_the_photo(estimator):
    corner = np.zeros(FRAME.shape[:2], np.uint8)
    corner[:50, :60] = 255
    answer = Session(estimator).process(FRAME // 8, corner, FrameRequest(light=False))
    expected = estimator.estimate(FRAME // 8, corner).to_json()["warnings"]
    assert answer.numbers["warnings"] == expected
    assert {warning["code"] for warning in expected} >= {"few-pixels", "touches-frame", "too-dark"}
    assert answer.numbers["mask_confidence"] is None


def test_only_what_is_wanted_is_estimated(estimator):
    answer = Session(estimator).process(FRAME, None, FrameRequest(material=False, light=True))
    assert list(answer.arrays) == ["mask"] and answer.numbers["material"] is None
    assert set(answer.numbers["ms"]) == {"framing_and_mask", "total"}
    answer = Session(estimator).process(FRAME, None, FrameRequest(light=False))
    assert "light" not in answer.arrays and answer.numbers["material"]


def test_a_painted_mask_is_taken(estimator):
    mask = np.zeros(FRAME.shape[:2], np.uint8)
    mask[40:90, 50:110] = 255
    answer = Session(estimator).process(FRAME, mask, FrameRequest(light=False))
    share = 50 * 60 / mask.size
    assert answer.numbers["mask_coverage"] == pytest.approx(share, rel=0.05)
    empty = Session(estimator).process(FRAME, np.zeros_like(mask), FrameRequest())
    assert not empty.numbers["found"] and empty.numbers["material"] is None
    assert [warning["code"] for warning in empty.numbers["warnings"]] == ["no-object"]


def test_material_and_light_are_fused_until_a_cut(estimator):
    session, other = Session(estimator), ball(radius=0.55, colour=(0.1, 0.2, 0.7))
    first = session.process(FRAME, None, FrameRequest())
    fused = session.process(other, None, FrameRequest())
    alone = Session(estimator).process(other, None, FrameRequest())
    assert not fused.numbers["cut"]
    low, high = sorted(answer.numbers["material"]["diffuse_albedo"][2] for answer in (first, alone))
    assert low < fused.numbers["fused"]["diffuse_albedo"][2] < high
    assert not np.array_equal(fused.arrays["light"], alone.arrays["light"])
    scene = 255 - FRAME
    answer = session.process(scene, None, FrameRequest())
    assert answer.numbers["cut"]
    if answer.numbers["found"]:
        again = Session(estimator).process(scene, None, FrameRequest())
        assert answer.numbers["fused"] == again.numbers["fused"]
        assert np.array_equal(answer.arrays["light"], again.arrays["light"])


def test_a_frame_of_the_mask_alone_keeps_what_was_fused(estimator):
    session = Session(estimator)
    first = session.process(FRAME, None, FrameRequest(light=False))
    second = session.process(FRAME, None, FrameRequest(material=False))
    assert second.numbers["fused"] == first.numbers["fused"]


def test_strokes_of_a_mask_are_no_frames(estimator):
    session = Session(estimator)
    first = session.process(FRAME, None, FrameRequest(light=False))
    mask = np.zeros(FRAME.shape[:2], np.uint8)
    mask[: len(mask) // 2] = 255
    for _ in range(3):
        painted = session.process(FRAME, mask, FrameRequest(light=False, fusion=False))
        assert painted.numbers["material"] != first.numbers["material"]
    nothing = session.process(FRAME, None, FrameRequest(material=False))
    assert nothing.numbers["fused"] == first.numbers["fused"]


def test_a_lost_object_and_a_restart_forget(estimator):
    nothing = np.zeros(FRAME.shape[:2], np.uint8)
    session = Session(estimator)
    session.process(FRAME, None, FrameRequest(light=False))
    for _ in range(LOST_AFTER):
        assert session.process(FRAME, nothing, FrameRequest()).numbers["fused"]
    assert session.process(FRAME, nothing, FrameRequest()).numbers["fused"] is None
    session.process(FRAME, None, FrameRequest(light=False))
    session.restart()
    assert session.process(FRAME, nothing, FrameRequest()).numbers["fused"] is None


@pytest.mark.parametrize("level", [0, 255])
@pytest.mark.parametrize("shape", [(1, 1), (16, 500)])
def test_frames_without_anything_are_answers(level, shape, estimator):
    image = np.full((*shape, 3), level, np.uint8)
    for mask in (None, np.full(shape, 255, np.uint8)):
        answer = Session(estimator).process(image, mask, FrameRequest())
        json.dumps(answer.numbers, allow_nan=False)
        assert all(np.isfinite(array).all() for array in answer.arrays.values())


class Counting:
    """An engine that counts the images that SegmentationNet sees."""

    def __init__(self, engine):
        self.looks, self._engine = 0, engine

    def __getattr__(self, name):
        return getattr(self._engine, name)

    def run(self, outputs, given):
        self.looks += len(given["image"]) if "mask" in outputs else 0
        return self._engine.run(outputs, given)


SMALL = FrameRequest(layers=False, light=False, fusion=False)


def test_a_stream_looks_where_the_object_was(estimator, monkeypatch):
    engine = Counting(estimator._engine)
    monkeypatch.setattr(estimator, "_engine", engine)
    session, looks = Session(estimator), []
    for step in range(6):
        frame = ball(480, 640, radius=0.3, place=(-0.3 + 0.03 * step, 0.1))
        before = engine.looks
        found = session.process(frame, None, SMALL).numbers
        looks.append(engine.looks - before)
        expected = estimator.estimate(frame)
        assert found["material"]["exponent"] == pytest.approx(expected.exponent, rel=0.35)
        for channel, value in zip(
            found["material"]["diffuse_albedo"], expected.diffuse_albedo, strict=True
        ):
            assert channel == pytest.approx(value, abs=0.05)
        assert found["mask_coverage"] == pytest.approx(expected.mask_coverage, rel=0.05)
    assert looks == [2, 1, 1, 1, 1, 1]
    before = engine.looks
    for alone in (Session(estimator), session):
        for _ in range(3):
            alone.process(frame, None, FrameRequest(material=False))
    assert engine.looks - before == 2 + 1 + 1 + 3  # masks alone are followed, too


def test_an_object_that_left_its_square_is_found_again(estimator, monkeypatch):
    session = Session(estimator)
    for place in ((-0.8, 0.2), (0.8, -0.2)):
        frame = ball(480, 640, radius=0.25, place=place)
        found = session.process(frame, None, SMALL).numbers
        assert found["found"] and tuple(found["square"]) == estimator.estimate(frame).square
    nothing = np.full((480, 640, 3), 120, np.uint8)
    square = session.process(nothing, None, SMALL).numbers["square"]
    assert tuple(square) == (-80, 0, 640) and session._square is None


def test_layers_and_warnings_come_when_they_are_asked_for(estimator):
    session, dark = Session(estimator), FRAME // 8
    first = session.process(dark, None, FrameRequest(light=False))
    assert set(first.arrays) == {"mask", "specular_shading", "mirror"}
    plain = session.process(dark, None, FrameRequest(layers=False, light=False))
    assert set(plain.arrays) == {"mask"}
    assert plain.numbers["warnings"] == first.numbers["warnings"] != []
    assert plain.numbers["material"]["exponent"] == pytest.approx(
        first.numbers["material"]["exponent"], rel=1e-5
    )


def test_levels_of_a_frame_are_cut_as_those_of_a_photo():
    for square in ((0, 0, 90), (-20, 7, 300), (10, 10, 64), (30, 40, 31)):
        levels, photo = (
            framing.cut(picture, framing.Square(*square), 64)
            for picture in (FRAME, FRAME / np.float32(255))
        )
        np.testing.assert_array_equal(levels, photo)
