"""CONTRIBUTING shows the rooms as they are, and names files that there are."""

import re
from pathlib import Path

import pytest
import script_files

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
CHANGES = dict(re.findall(r"^\| an? (.+?) \| (.+) \|$", PAGE, re.MULTILINE))


@pytest.fixture(scope="module")
def rooms():
    return script_files.load(ROOT / "docs" / "pictures" / "rooms.py")


def test_the_picture_is_drawn_from_the_imports(rooms):
    assert rooms.page() == PAGE, "draw it anew: make rooms"


def test_arrows_that_follow_from_others_are_left_out(rooms):
    arrows = {"a": {"b", "c", "d"}, "b": {"c"}, "c": {"d"}, "d": set(), "e": {"d"}}
    assert rooms.reduced(arrows) == {"a": {"b"}, "b": {"c"}, "c": {"d"}, "d": set(), "e": {"d"}}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_touches_few_files_and_all_are_there(change):
    folder, files = ROOT, []
    for name in re.findall(r"`([\w/-]+\.\w+)`", CHANGES[change]):
        path = ROOT / name if "/" in name else folder / name
        if name != "index.md":
            assert path.is_file(), name
        folder = path.parent
        files.append(path)
    assert 1 <= len(files) <= 8
