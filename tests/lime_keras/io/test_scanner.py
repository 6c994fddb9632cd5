"""The kinds of sources, told by their names."""

import time
from pathlib import Path

import pytest

from lime_keras.io import result_json, scanner
from lime_keras.io.scanner import (
    AmbiguousName,
    inside,
    is_camera,
    is_video,
    list_folder,
    mask_beside,
    of_photo,
    photo_of_mask,
)


def make(folder, *names):
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")


def test_names_tell_videos_and_cameras():
    for name in ("a.mp4", "a/b.MOV", "x.webm"):
        assert is_video(name) and not is_camera(name)
    for name in ("camera:0", "/dev/video0", "camera:My.jpg"):
        assert is_video(name) and is_camera(name)
    for name in ("a.png", "mp4", "a.mp4.jpg", "", "photos"):
        assert not is_video(name)


def test_a_mask_lies_beside_its_photo(tmp_path):
    make(tmp_path, "a.jpg", "a_mask.png", "b.PNG", "b_mask.png", "c_mask.png")
    make(tmp_path, "d.png", "d_mask.jpg")
    (tmp_path / "d_mask.png").mkdir()
    for name in "ab":
        mask = tmp_path / f"{name}_mask.png"
        assert photo_of_mask(mask).stem == name and mask_beside(photo_of_mask(mask)) == mask
    # Without its photo it is a photo; and no mask has a mask.
    for name in ("c_mask.png", "d_mask.jpg", "d_mask.png", "d.png", "gone_mask.png"):
        assert photo_of_mask(tmp_path / name) is None
    assert mask_beside(tmp_path / "d.png") is None
    assert mask_beside(tmp_path / "a_mask.png") is None


def test_pictures_in_all_folders_below_in_a_fixed_order(tmp_path):
    make(tmp_path, "b.png", "a.JPG", "c.mp4", "notes.txt", "z/a.png", "d/e/f.webm", "d/x.tif")
    make(tmp_path, ".git/a.png", "partial-a/a.png", ".a.txt")
    (tmp_path / "z" / "loop").symlink_to(tmp_path)
    found = [path.relative_to(tmp_path).as_posix() for path in inside(tmp_path)]
    assert found == ["a.JPG", "b.png", "c.mp4", "d/x.tif", "d/e/f.webm", "z/a.png"]


def test_what_the_command_wrote_is_no_source(tmp_path):
    make(tmp_path, "a.png", "a-mask.png", "a-overlay.mp4", "b-mask.png")
    (tmp_path / "b.json").write_text('{"files": ["b-mask.png"]}')
    result_json.write(tmp_path / "a.json", {}, {}, ["a-mask.png", "a-overlay.mp4", "a.json"])
    assert [path.name for path in inside(tmp_path)] == ["a.png", "b-mask.png"]


def test_what_systems_leave_in_folders_is_no_photo(tmp_path):
    """Small files of macOS beside photos, copies on network disks; a link to itself is listed."""
    make(tmp_path, "a.png", "._a.png", ".DS_Store", "__MACOSX/a.png", "@eaDir/a.jpg/S.jpg")
    (tmp_path / "loop.png").symlink_to("loop.png")
    (tmp_path / "gone.png").symlink_to("nowhere.png")
    (tmp_path / "folder.png").mkdir()
    names = [path.name for path in inside(tmp_path)]
    assert names == ["a.png", "gone.png", "loop.png"]
    assert [path.name for path in list_folder(tmp_path, (".png",))] == names


def test_a_mask_in_capitals_lies_beside_its_photo(tmp_path):
    make(tmp_path, "FOX.PNG", "FOX_mask.PNG", "hat.jpg", "HAT_MASK.PNG", "cup.png", "cup_mask.png")
    for photo, mask in (("FOX.PNG", "FOX_mask.PNG"), ("hat.jpg", "HAT_MASK.PNG")):
        assert mask_beside(tmp_path / photo) == tmp_path / mask
        assert photo_of_mask(tmp_path / mask) == tmp_path / photo
    make(tmp_path, "cup_mask.PNG")
    assert mask_beside(tmp_path / "cup.png") == tmp_path / "cup_mask.png"


def test_accents_of_one_and_of_two_characters_are_alike(tmp_path):
    """A Mac's archive may hold both: photos as its disk names them, masks as a program does."""
    make(tmp_path, "fu\u0308chs.jpg", "f\u00fcchs_mask.png", "masks/F\u00dcCHS.png")
    photo, mask = tmp_path / "fu\u0308chs.jpg", tmp_path / "f\u00fcchs_mask.png"
    assert mask_beside(photo) == mask and photo_of_mask(mask) == photo
    assert of_photo(photo, tmp_path / "masks").name == "F\u00dcCHS.png"
    assert [path.name for path in inside(tmp_path)] == [photo.name, "F\u00dcCHS.png"]


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        (["fox.png", "fox.json", "._fox.png", "fox.txt"], "fox.png"),
        (["fox.tif"], "fox.tif"),
        (["fox.jpg.png"], "fox.jpg.png"),
        (["fox_mask.png"], "fox_mask.png"),
        (["FOX.PNG"], "FOX.PNG"),
        (["fox.png", "FOX.PNG"], "fox.png"),
        (["fox.png", "fox.jpg.png", "fox_mask.png"], "fox.png"),
        (["fox.png", "fox.jpg"], "fox.jpg"),
        (["fox.png", "a/fox.png"], "a/fox.png"),
        (["fox.png", "photos/a/fox.png", "b/fox.png"], "photos/a/fox.png"),
    ],
)
def test_the_mask_of_a_photo_in_a_folder_of_masks(files, expected, tmp_path):
    masks = tmp_path / "masks"
    make(masks, *files)
    assert of_photo(tmp_path / "photos/a/fox.jpg", masks) == masks / expected


def test_a_folder_of_masks_is_listed_once(tmp_path, monkeypatch):
    for index in range(5):
        (tmp_path / f"{index}.png").touch()
    listed, list_folder = [], scanner.list_folder
    monkeypatch.setattr(scanner, "list_folder", lambda *a: listed.append(a) or list_folder(*a))
    for index in range(5):
        assert scanner.of_photo(Path(f"/photos/{index}.jpg"), tmp_path).stem == str(index)
    assert len(listed) == 1
    time.sleep(0.02)
    (tmp_path / "new.png").touch()
    assert scanner.of_photo(Path("/photos/new.jpg"), tmp_path).stem == "new"


def test_no_photo_is_its_own_mask_however_it_is_spelled(tmp_path, monkeypatch):
    make(tmp_path, "fox.jpg", "fox_mask.png")
    monkeypatch.chdir(tmp_path)
    linked = tmp_path.with_name("linked")
    linked.symlink_to(tmp_path)
    for photo in (tmp_path / "fox.jpg", Path("fox.jpg")):
        for folder in (tmp_path, Path(), Path("../" + tmp_path.name), linked):
            assert of_photo(photo, folder).name == "fox_mask.png"


@pytest.mark.parametrize(
    "files", [["fox.png", "fox.tif"], ["Fox.png", "FOX.png"], ["fox.jpg.png", "fox.jpg.tif"]]
)
def test_two_masks_of_one_photo_are_refused(files, tmp_path):
    make(tmp_path, *files)
    with pytest.raises(AmbiguousName, match=r"holds .* and .*: keep one"):
        of_photo(Path("photos/fox.jpg"), tmp_path)
