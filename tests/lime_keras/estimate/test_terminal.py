"""The answer for a person at a terminal."""

import io
from pathlib import Path

import numpy as np
import pytest

from lime_keras.estimate import terminal
from lime_keras.material import Caution, Material

WHOLE = Material(
    diffuse_albedo=np.array([0.5, 0.2, 0.1]),
    specular_albedo=0.047,
    exponent=20.0,
    exponent_bin_probabilities=np.eye(8)[3],
    mask_coverage=0.5,
    warnings=(Caution("grey", "it is grey"),),
)
FILES = ["vase-mask.png", "vase-preview.png", "vase.gltf", "vase.json", "vase-mitsuba.json"]


def content(material=WHOLE, files=FILES, **more):
    return {"photo": "photos/vase.jpg"} | material.to_json() | {"files": files} | more


def test_four_lines_tell_a_photo():
    lines = terminal.describe(content(), Path("out"), colour=False).splitlines()
    assert lines == [
        "photos/vase.jpg",
        "  #bc7c59   rather matte (71 %), s 20 (15 to 29)   specular 0.05",
        "  ! it is grey",
        "  out/: vase-preview.png, vase.gltf, vase-mitsuba.json, vase.json and 1 more",
    ]


def test_the_swatch_has_the_colour_of_its_hex():
    line = terminal.material(content(), colour=True)
    assert line.startswith("\x1b[48;2;188;124;89m    \x1b[0m #bc7c59")


def test_a_gloss_is_told_with_the_interval_of_the_exponent():
    flat = Material(exponent=20.0, exponent_bin_probabilities=np.full(8, 0.125))
    told = terminal.material(flat.to_json(), colour=False)
    assert told == "rather matte (71 %), s 20 (2.0 to 501)"


def test_a_photo_without_an_object_has_no_material():
    nothing = Material(mask_coverage=0.0, warnings=(Caution("no-object", "nothing there"),))
    lines = terminal.describe(content(nothing), Path("out"), ["more"], colour=False).splitlines()
    assert lines[1:4] == ["  no material", "  ! nothing there", "  ! more"]


def test_a_mask_alone_says_how_much_it_covers():
    found = Material(mask_coverage=0.4804)
    assert terminal.material(found.to_json(), colour=False) == "mask alone, 48.0% of the picture"


def test_each_scene_of_a_video_has_its_line():
    scenes = [{"scene": n, "gloss": "matte", "exponent": 3.0, "warnings": []} for n in (1, 4)]
    told = {"video": "clip.mp4", "scenes": scenes, "files": ["clip.csv"], "warnings": []}
    lines = terminal.describe(told, Path("out"), colour=False).splitlines()
    assert lines[1:3] == ["  scene 1  matte, s 3.0", "  scene 4  matte, s 3.0"]


@pytest.mark.parametrize(
    ("variables", "expected"),
    [({}, True), ({"NO_COLOR": "1"}, False), ({"NO_COLOR": ""}, True), ({"TERM": "dumb"}, False)],
)
def test_colour_is_for_terminals_that_show_it(variables, expected, monkeypatch):
    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    stream = io.StringIO()
    assert not terminal.takes_colour(stream)
    stream.isatty = lambda: True
    assert terminal.takes_colour(stream) is expected
