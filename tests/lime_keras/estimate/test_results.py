"""Results: whole or not there, kept if they would be the same, and never lost unasked."""

import os
from pathlib import Path

import json_files
import pytest

from lime_keras.estimate.files import distinct_names
from lime_keras.estimate.results import Results
from lime_keras.io import result_json


@pytest.fixture
def photo(tmp_path):
    (tmp_path / "photo.png").write_bytes(b"a photo")
    return tmp_path / "photo.png"


def results(tmp_path, weights="w" * 64, overwrite=False, **options):
    return Results(tmp_path / "out", weights, options, overwrite=overwrite)


def write(found, photo, name="sub/a", files=("a-mask.png", "a.mtl"), beside=()):
    with found.writing(name, found.provenance(photo, dict(beside))) as draft:
        for file in files:
            (draft.folder / file).write_text(name)
        draft.numbers = {"exponent": 3.0}
    return draft.numbers


def test_what_would_be_the_same_is_kept(tmp_path, photo):
    found = results(tmp_path, only=["mask"])
    assert found.existing({"sub/a": lambda: found.provenance(photo, {})}).get("sub/a") is None
    told = write(found, photo)
    again = results(tmp_path, only=["mask"], shadow=False)
    kept = again.existing({"sub/a": lambda: again.provenance(photo, {})}).get("sub/a")
    assert kept == told
    assert kept["exponent"] == 3 and kept["files"] == ["a-mask.png", "a.json", "a.mtl"]
    assert {path.name for path in (tmp_path / "out" / "sub").iterdir()} == set(kept["files"])
    # A photo that was moved is the same photo.
    moved = photo.rename(tmp_path / "other.png")
    assert again.existing({"sub/a": lambda: again.provenance(moved, {})}).get("sub/a") == kept


@pytest.mark.parametrize(
    ("change", "told"),
    [({"weights": "v" * 64}, "weights"), ({"only": ["mask"], "shadow": True}, "--only, --shadow")],
    ids=["weights", "options"],
)
def test_what_was_made_otherwise_is_refused(change, told, tmp_path, photo):
    write(results(tmp_path), photo)
    other = results(tmp_path, **change)
    with pytest.raises(ValueError, match=rf"sub/a\.json was made with another {told}: pass --"):
        other.existing({"sub/a": lambda: other.provenance(photo, {})}).get("sub/a")
    other = results(tmp_path, overwrite=True, **change)
    assert other.existing({"sub/a": lambda: other.provenance(photo, {})}).get("sub/a") is None


def test_a_photo_that_went_is_no_conflict_before_its_turn_comes(tmp_path, photo):
    found = results(tmp_path)
    write(found, photo, name="a")
    photo.unlink()
    assert found.existing({"a": lambda: found.provenance(photo, {})}) == {}
    places = [Path("a.jpg"), Path("a.png")]
    assert found.keep_names(["a", "a-2"], [photo, photo], places) == ["a", "a-2"]


def test_a_new_photo_called_as_a_numbered_result_takes_another_name(tmp_path):
    photos = [tmp_path / name for name in ("a-2.jpg", "a.jpg", "a.png")]
    for photo in photos:
        photo.write_bytes(photo.name.encode())
    found = results(tmp_path)
    for photo, name in ((photos[1], "a"), (photos[2], "a-2")):
        write(found, photo, name=name, files=())
    places = [Path(photo.name) for photo in photos]
    assert found.keep_names(["a-2", "a", "a-3"], photos, places) == ["a-3", "a", "a-2"]


def test_a_sequence_keeps_its_numbers_whatever_frames_show(tmp_path):
    """Frames that are numbered anew have each other's contents."""
    photos, names = [tmp_path / f"frame-{k}.jpg" for k in (1, 2)], ["frame-1", "frame-2"]
    found = results(tmp_path)
    for photo, name in zip(photos, names, strict=True):
        photo.write_bytes(name.encode())
        write(found, photo, name=name, files=())
    photos[0].write_bytes(b"frame-2")
    photos[1].write_bytes(b"frame-1")
    places = [Path(photo.name) for photo in photos]
    assert found.keep_names(names, photos, places) == names


def test_overwrite_replaces_only_what_would_differ(tmp_path, photo):
    write(results(tmp_path), photo, name="a")
    found = results(tmp_path, overwrite=True)
    assert found.existing({"a": lambda: found.provenance(photo, {})})
    found = results(tmp_path, overwrite=True, weights="v" * 64)
    assert not found.existing({"a": lambda: found.provenance(photo, {})})


def test_another_photo_and_another_mask_are_refused(tmp_path, photo):
    found = results(tmp_path)
    write(found, photo, beside={"mask": photo})
    with pytest.raises(ValueError, match="with another mask or normals"):
        found.existing({"sub/a": lambda: found.provenance(photo, {})}).get("sub/a")
    photo.write_bytes(b"another photo")
    with pytest.raises(ValueError, match="with another source, mask or normals"):
        found.existing({"sub/a": lambda: found.provenance(photo, {})}).get("sub/a")
    made = found.provenance(None, {})
    write(found, None, name="camera-0")
    with pytest.raises(ValueError, match="was made of an earlier recording"):
        found.existing({"camera-0": lambda: made}).get("camera-0")


@pytest.mark.parametrize(
    "content",
    [
        *("", "{}", "[1]", '{"made": 1, "files": []}', '{"made": {}}'),
        '{"made": {"options": "full-size"}, "files": []}',
    ],
)
def test_another_file_of_that_name_is_refused(content, tmp_path, photo):
    found = results(tmp_path)
    path = tmp_path / "out" / "a.json"
    path.parent.mkdir()
    path.write_text(content)
    with pytest.raises(ValueError, match=r"a\.json is no result of lime-estimate"):
        found.existing({"a": lambda: found.provenance(photo, {})}).get("a")
    with pytest.raises(ValueError, match=r"a\.json is there, and no part of an earlier result"):
        write(found, photo, name="a")
    assert path.read_text() == content and len(list(path.parent.iterdir())) == 1
    write(results(tmp_path, overwrite=True), photo, name="a")
    assert result_json.read(path)["exponent"] == 3


def test_a_layers_file_that_is_none_is_not_replaced(tmp_path, photo):
    found = results(tmp_path)
    mine = tmp_path / "out" / "a-mask.png"
    mine.parent.mkdir()
    mine.write_text("mine")
    with pytest.raises(ValueError, match=r"a-mask\.png is there"):
        write(found, photo, name="a")
    assert mine.read_text() == "mine" and len(list(mine.parent.iterdir())) == 1


def test_a_result_that_lacks_a_file_is_made_again(tmp_path, photo):
    found = results(tmp_path)
    write(found, photo)
    (tmp_path / "out" / "sub" / "a.mtl").unlink()
    assert found.existing({"sub/a": lambda: found.provenance(photo, {})}).get("sub/a") is None
    write(found, photo)
    assert found.existing({"sub/a": lambda: found.provenance(photo, {})}).get("sub/a") is not None


def test_of_a_result_that_is_replaced_nothing_is_left(tmp_path, photo):
    write(results(tmp_path), photo, files=("a-mask.png", "a.mtl", "a.gltf"))
    (tmp_path / "out" / "sub" / "a-notes.txt").write_text("mine")
    write(results(tmp_path, only=["mask"], overwrite=True), photo, files=("a-mask.png",))
    names = {path.name for path in (tmp_path / "out" / "sub").iterdir()}
    assert names == {"a.json", "a-mask.png", "a-notes.txt"}


def test_what_fails_leaves_nothing_and_keeps_what_was(tmp_path, photo):
    found = results(tmp_path)
    write(found, photo)
    before = {path.name: path.read_text() for path in (tmp_path / "out" / "sub").iterdir()}
    with (
        pytest.raises(KeyboardInterrupt),
        found.writing("sub/a", found.provenance(photo, {})) as draft,
    ):
        (draft.folder / "a-mask.png").write_text("half")
        raise KeyboardInterrupt
    after = {path.name: path.read_text() for path in (tmp_path / "out" / "sub").iterdir()}
    assert after == before


def test_the_numbers_go_first_and_come_last(tmp_path, photo, monkeypatch):
    """So a command that is killed in between leaves no result that counts as whole."""
    write(results(tmp_path), photo)
    moves = []
    unlink, replace = Path.unlink, os.replace

    def watched_unlink(path, missing_ok=False):
        moves.append(("gone", path.name))
        unlink(path, missing_ok)

    def watched_replace(source, target):
        moves.append(("there", Path(target).name))
        replace(source, target)

    monkeypatch.setattr(Path, "unlink", watched_unlink)
    monkeypatch.setattr("lime_keras.estimate.results.os.replace", watched_replace)
    write(results(tmp_path, overwrite=True), photo)
    gone = [name for move, name in moves if move == "gone" and not name.startswith("partial-")]
    there = [name for move, name in moves if move == "there"]
    assert gone[0] == "a.json" and {"a-mask.png", "a.mtl"} <= set(gone[1:])
    assert there[-1] == "a.json" and {"a-mask.png", "a.mtl"} <= set(there[:-1])


def test_an_unfinished_recording_is_made_again(tmp_path, photo):
    found = results(tmp_path)
    made = found.provenance(photo, {})
    with pytest.raises(KeyboardInterrupt), found.growing("clip", made, [".csv"]):
        (tmp_path / "out" / "clip.csv").write_text("frame\n0\n")
        raise KeyboardInterrupt
    assert (tmp_path / "out" / "clip.csv").exists()
    assert not found.existing({"clip": lambda: made})
    with found.growing("clip", made, [".csv"]):
        assert not (tmp_path / "out" / "clip.csv").exists()


def test_files_of_any_number_are_in_the_way_and_go_with_an_unfinished_result(tmp_path, photo):
    found, out = results(tmp_path), tmp_path / "out"
    made, ends = found.provenance(photo, {}), [".csv", "-scene-*.mtl"]
    out.mkdir(exist_ok=True)
    mine = out / "clip-scene-2.mtl"
    mine.write_text("mine")
    with pytest.raises(ValueError, match=r"clip-scene-2.mtl is there, and no part"):
        with found.growing("clip", made, ends):
            raise AssertionError("never reached")
    assert mine.read_text() == "mine" and not (out / "clip.json").exists()
    mine.unlink()
    with pytest.raises(KeyboardInterrupt), found.growing("clip", made, ends):
        mine.write_text("of the second scene")
        raise KeyboardInterrupt
    with found.growing("clip", made, ends):
        assert not mine.exists()
    with pytest.raises(ValueError, match="broken"), found.growing("clip", made, ends):
        mine.write_text("of the second scene")
        raise ValueError("broken")
    assert not mine.exists()


def test_a_video_takes_no_files_of_a_photo_that_is_called_like_its_scenes(tmp_path, photo):
    found, ends = results(tmp_path), [".csv", "-scene-*.mtl"]
    made = found.provenance(photo, {})
    with pytest.raises(KeyboardInterrupt), found.growing("a", made, ends):
        raise KeyboardInterrupt
    write(found, photo, name="a-scene-1", files=("a-scene-1.mtl",))
    with pytest.raises(ValueError, match=r"a-scene-1.mtl is there, and no part"):
        with found.growing("a", made, ends):
            raise AssertionError("never reached")
    assert (tmp_path / "out" / "a-scene-1.mtl").is_file()


def test_an_unfinished_recording_of_a_camera_is_not_replaced_unasked(tmp_path):
    found = results(tmp_path)
    with pytest.raises(OSError), found.growing("camera-0", found.provenance(None, {}), [".csv"]):
        raise OSError("disk full")
    with pytest.raises(ValueError, match="was made of an earlier recording"):
        found.existing({"camera-0": lambda: found.provenance(None, {})})


def test_files_elsewhere_are_never_taken_for_parts_of_a_result(tmp_path, photo):
    found = results(tmp_path, overwrite=True)
    write(found, photo, name="a")
    path = tmp_path / "out" / "a.json"
    with json_files.edited(path) as content:
        content["files"] = ["../photo.png", "/etc/x", "..", ".", 3]
    assert result_json.read(path)["files"] == []
    write(found, photo, name="a")
    assert photo.read_bytes() == b"a photo"


def test_names_that_a_disk_may_take_for_one_are_numbered():
    """A Mac's disk has one form of accents, and Windows' one case."""
    sources = ["\u00fc.png", "u\u0308.png", "U\u0308.jpg", "u.png"]
    names = ["\u00fc", "u\u0308-2", "U\u0308-3", "u"]
    assert distinct_names(map(Path, sources)) == names
