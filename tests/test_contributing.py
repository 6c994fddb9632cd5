"""CONTRIBUTING shows the rooms as they are, and names files that there are."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
CHANGES = dict(re.findall(r"^\| an? (.+?) \| (.+) \|$", PAGE, re.MULTILINE))


@pytest.fixture(scope="module")
def rooms():
    path = ROOT / "docs" / "pictures" / "rooms.py"
    spec = importlib.util.spec_from_file_location("rooms", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_picture_is_drawn_from_the_imports(rooms):
    assert rooms.page() == PAGE, "draw it anew: make rooms"


def test_a_room_has_an_arrow_to_each_room_that_it_imports(rooms):
    arrows = rooms.arrows()
    assert {"train/photos", "render/scene", "eval/report", "lime_keras/optics"} <= arrows.keys()
    assert (
        "lime_keras/optics" in arrows["render/scene"] and "lime_keras/io" in arrows["train/photos"]
    )
    assert arrows["lime_keras/optics"] == set() and "render/corpus" not in arrows["render/scene"]


def test_arrows_that_follow_from_others_are_left_out(rooms):
    arrows = {"a": {"b", "c", "d"}, "b": {"c"}, "c": {"d"}, "d": set(), "e": {"d"}}
    assert rooms.reduced(arrows) == {"a": {"b"}, "b": {"c"}, "c": {"d"}, "d": set(), "e": {"d"}}


def test_from_folder_to_folder_there_is_one_arrow(rooms):
    arrows = {
        "lime_keras/io": set(),
        "lime_keras/commands": {"lime_keras/io", "render/a"},
        "render/a": {"lime_keras/io"},
        "render/b": {"render/a", "lime_keras/io"},
        "train": {"lime_keras/io"},
    }
    lines = [line.strip() for line in rooms.diagram(arrows).splitlines()]
    assert [line for line in lines if "-->" in line] == [
        "render_b --> render_a",
        "lime_keras_commands --> render",
        "render --> lime_keras",
        "train --> lime_keras",
    ]
    assert lines.count("subgraph render") == lines.count("train") == 1
    assert "render_a([a])" in lines


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_touches_few_files_and_all_are_there(change):
    folder, files = ROOT, []
    for name in re.findall(r"`([\w/]+\.\w+)`", CHANGES[change]):
        path = ROOT / name if "/" in name else folder / name
        if name != "index.md":
            assert path.is_file(), name
        folder = path.parent
        files.append(path)
    assert 1 <= len(files) <= 5


def test_eight_changes_are_described():
    assert len(CHANGES) == 8
