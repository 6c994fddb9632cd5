"""Scenes: where they end, what they are made of, and their files."""

import dataclasses
import json

import numpy as np
import pytest

from lime_keras import Material
from lime_keras.io.video_reader import Frame
from lime_keras.material import Caution
from lime_keras.video import scenes
from lime_keras.video.tracking import LOST_AFTER, Tracker

NOTHING = Material(mask_coverage=0.0)


def material(exponent, coverage=0.25):
    mask = np.zeros((24, 32, 1), np.float32)
    mask[6:18, 8:24] = 1
    return Material(
        np.array([0.5, 0.3, 0.2]), 0.4, exponent, mask_coverage=coverage, layers={"mask": mask}
    )


def told(*shots):
    """The scenes of shots, each a list of estimates of frames of one grey level."""
    out, tracker, time = scenes.Scenes(), Tracker(), 0
    for number, shot in enumerate(shots):
        for found in shot:
            frame = Frame(np.full((24, 32, 3), 60 + 80 * (number % 2), np.uint8), time / 25)
            out.add(frame, found, tracker.step(frame.image_srgb, found))
            time += 1
    return out.with_objects()


def test_a_scene_ends_with_a_cut():
    first, second = told([material(10.0)] * 4, [material(100.0)] * 6)
    assert (first.number, first.frames, first.found, first.start) == (1, 4, 4, 0)
    assert (second.number, second.frames) == (2, 6)
    assert (first.end, second.start, second.end) == pytest.approx((3 / 25, 4 / 25, 9 / 25))
    assert first.material.exponent == pytest.approx(10)
    assert second.material.exponent == pytest.approx(100)
    assert first.to_json()["scene"] == 1 and second.to_json()["exponent"] == pytest.approx(100)


def test_a_scene_without_an_object_counts_but_is_left_out():
    found = told([material(10.0)] * 2, [NOTHING] * 3, [material(20.0)] * 2)
    assert [scene.number for scene in found] == [1, 3]
    assert told([NOTHING] * 3) == []


def test_a_lost_object_ends_its_scene():
    lost = [NOTHING] * (LOST_AFTER + 1)
    first, second = told([material(10.0), *lost, material(1000.0)])
    assert first.material.exponent == pytest.approx(10)
    assert second.material.exponent == pytest.approx(1000)
    assert (first.frames, second.frames) == (1 + LOST_AFTER, 2)
    (only,) = told([material(10.0), *lost[:-1], material(10.0)])
    assert (only.frames, only.found) == (2 + LOST_AFTER, 2)


def test_a_scene_is_shown_by_the_frame_with_the_largest_object():
    (scene,) = told([material(10.0, 0.2), material(10.0, 0.4), material(10.0, 0.3)])
    assert scene.material.mask_coverage == 0.4 and scene.image_srgb[0, 0, 0] == 60
    # Of the frame's estimate it keeps what it shows: a video may have hundreds of scenes.
    assert scene._largest.image_srgb is None and set(scene._largest.layers) <= {"mask"}
    scene.close()
    assert scene.image_srgb is None and not scene.material.layers and scene.preview


def test_what_half_of_the_frames_say_is_the_scenes():
    """Frames without an object do not count."""

    def frame(*codes, confidence=0.9, probabilities=None, words="say"):
        return dataclasses.replace(
            material(10.0),
            mask_confidence=confidence,
            exponent_bin_probabilities=probabilities,
            warnings=tuple(Caution(code, f"{words} {code}") for code in codes),
        )

    often = frame("clipped", "too-dark"), frame("clipped", words="at last")
    others = frame(confidence=0.5, probabilities=np.eye(8)[2]), frame(confidence=0.7)
    (scene,) = told([*often, NOTHING, *others, frame(probabilities=np.eye(8)[4]), NOTHING])
    assert scene.material.warnings == ()
    (scene,) = told([*often, NOTHING, *others, NOTHING])
    found = scene.material
    assert found.warnings == (Caution("clipped", "in 50% of the frames, at last clipped"),)
    assert found.mask_confidence == pytest.approx((0.9 + 0.9 + 0.5 + 0.7) / 4)
    np.testing.assert_array_equal(found.exponent_bin_probabilities, np.eye(8)[2])
    assert found.exponent_entropy == 0


def test_each_scene_leaves_the_files_of_a_photo(tmp_path):
    found = told([material(10.0)], [material(100.0)])
    ends = (".mtl", ".gltf", "-mitsuba.json", "-preview.png")
    names = scenes.write(tmp_path, "clip", found)
    assert names == [f"clip-scene-{n}{end}" for n in (1, 2) for end in ends]
    assert sorted(names) == sorted(path.name for path in tmp_path.iterdir())
    assert "Ns 100.0000" in (tmp_path / "clip-scene-2.mtl").read_text()
    json.loads((tmp_path / "clip-scene-1-mitsuba.json").read_text())
    assert scenes.write(tmp_path, "clip", found[1:]) == [f"clip{end}" for end in ends]


def test_an_unfinished_material_has_a_preview_alone(tmp_path):
    part = Material(None, None, 30.0, mask_coverage=0.3, layers=material(1.0).layers)
    assert scenes.write(tmp_path, "clip", told([part])) == ["clip-preview.png"]
    assert scenes.write(tmp_path, "clip", []) == []
