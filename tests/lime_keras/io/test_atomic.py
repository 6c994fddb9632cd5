"""Files and folders are whole or not there."""

import errno
import os

import full_disk
import numpy as np
import pytest

from lime_keras.io import atomic


def test_a_failing_write_leaves_the_old_file(tmp_path, monkeypatch):
    (tmp_path / "metrics.json").write_text("old", encoding="utf-8")

    def full(*_):
        raise OSError("no space left")

    monkeypatch.setattr(atomic.os, "replace", full)
    with pytest.raises(OSError, match="no space"):
        atomic.write(tmp_path / "metrics.json", b"new")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_folders_are_made(tmp_path):
    atomic.write(tmp_path / "a" / "b.txt", b"content")
    assert (tmp_path / "a" / "b.txt").read_bytes() == b"content"


def test_text_is_utf8(tmp_path):
    atomic.write(tmp_path / "b.txt", "ꟻ")
    assert (tmp_path / "b.txt").read_bytes() == "ꟻ".encode()


def test_a_block_that_fails_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "curve.csv"
    atomic.write(path, "old")
    with pytest.raises(KeyboardInterrupt), atomic.replacing(path) as partial:
        partial.write_text("half", encoding="utf-8")
        raise KeyboardInterrupt
    assert [one.read_text() for one in tmp_path.iterdir()] == ["old"]
    with atomic.replacing(path) as partial:
        assert partial.suffix == path.suffix
        partial.write_text("new", encoding="utf-8")
    assert [one.read_text() for one in tmp_path.iterdir()] == ["new"]


def test_a_folder_takes_the_place_of_another_whole(tmp_path):
    path = tmp_path / "model"
    for content in ("old", "new"):
        with atomic.replacing(path) as partial:
            partial.mkdir()
            (partial / content).touch()
    assert [one.name for one in tmp_path.rglob("*")] == ["model", "new"]
    with pytest.raises(RuntimeError), atomic.replacing(path) as partial:
        partial.mkdir()
        (partial / "half").touch()
        raise RuntimeError
    assert [one.name for one in tmp_path.rglob("*")] == ["model", "new"]


def test_a_file_takes_no_folders_place(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "kept").touch()
    with pytest.raises(IsADirectoryError):
        atomic.write(tmp_path / "mine", "content")
    assert [one.name for one in tmp_path.rglob("*")] == ["mine", "kept"]


def test_what_an_interrupted_write_left_is_no_part_of_the_next(tmp_path):
    (tmp_path / "partial-model").mkdir()
    (tmp_path / "partial-model" / "left").touch()
    with atomic.replacing(tmp_path / "model") as partial:
        partial.mkdir()
    assert [one.name for one in tmp_path.rglob("*")] == ["model"]


def test_folders_made_for_a_block_that_fails_are_removed_but_no_others(tmp_path):
    (tmp_path / "there").mkdir()
    for path in (tmp_path / "a" / "b" / "file", tmp_path / "there" / "file"):
        with pytest.raises(RuntimeError), atomic.replacing(path):
            raise RuntimeError
    assert [one.name for one in tmp_path.iterdir()] == ["there"]


def test_two_processes_that_share_a_file_do_not_meet(tmp_path):
    path = tmp_path / "shard"
    with atomic.replacing(path, shared=True) as one, atomic.replacing(path, shared=True) as other:
        one.write_text("one", encoding="utf-8")
        other.write_text("other", encoding="utf-8")
        assert one != other and all(p.name.startswith("partial-") for p in (one, other))
    assert path.read_text(encoding="utf-8") == "one"
    assert [found.name for found in tmp_path.iterdir()] == ["shard"]


def test_a_full_disk_is_told_with_the_file_and_the_mend(tmp_path):
    def saved(partial):
        with partial.open("wb") as file:
            np.savez(file, np.zeros(1000))

    for write in (lambda partial: partial.write_bytes(bytes(5000)), saved):
        path = tmp_path / "new" / "file"
        with (
            pytest.raises(OSError, match=r"new/file cannot be written: .*; .*ulimit") as told,
            full_disk.files_end_after(1000),
            atomic.replacing(path) as partial,
        ):
            write(partial)
        assert told.value.errno == errno.EFBIG
        assert not list(tmp_path.iterdir())


def test_a_device_without_room_is_told(tmp_path):
    with (
        pytest.raises(OSError, match="file cannot be written: No space left on device; make room"),
        atomic.replacing(tmp_path / "file"),
        open("/dev/full", "wb", buffering=0) as full,
    ):
        full.write(b"content")


def test_an_error_of_another_file_keeps_its_words(tmp_path):
    with pytest.raises(FileNotFoundError, match="source") as told, atomic.replacing(tmp_path / "f"):
        (tmp_path / "source").read_bytes()
    assert "cannot be written" not in str(told.value)


def test_a_folder_whose_name_a_file_has_is_told(tmp_path):
    (tmp_path / "out").touch()
    with pytest.raises(OSError, match=r"out/f cannot be written: .*; a file has the name of its f"):
        atomic.write(tmp_path / "out" / "f", b"")


def test_a_suffix_that_fills_the_name_is_told(tmp_path):
    with pytest.raises(OSError, match="cannot be written: File name too long; shorten its name"):
        atomic.write(tmp_path / f"v1.{'x' * 260}", b"")


def _replaced(path, content, monkeypatch, before):
    """Replace a folder; `before` is called once, just before the new one takes its name."""
    replace, left = os.replace, [before]

    def replacing(source, target):
        if target == path and "old-" not in source.name and left:
            left.pop()()
        return replace(source, target)

    monkeypatch.setattr(atomic.os, "replace", replacing)
    with atomic.replacing(path, shared=True) as partial:
        partial.mkdir()
        (partial / content).touch()


def test_of_two_processes_that_replace_a_folder_the_last_wins(tmp_path, monkeypatch):
    path = tmp_path / "model"

    def overtake():
        path.mkdir()
        (path / "theirs").touch()

    _replaced(path, "ours", monkeypatch, overtake)
    assert [one.name for one in tmp_path.rglob("*")] == ["model", "ours"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, PermissionError(13, "denied")])
def test_a_folder_that_cannot_be_replaced_stays_whole(error, tmp_path, monkeypatch):
    path = tmp_path / "model"
    path.mkdir()
    (path / "old").touch()

    def fail():
        raise error

    with pytest.raises((KeyboardInterrupt, PermissionError)):
        _replaced(path, "new", monkeypatch, fail)
    assert [one.name for one in tmp_path.rglob("*")] == ["model", "old"]


def test_what_cannot_be_removed_of_an_old_folder_keeps_no_new_one_away(tmp_path, monkeypatch):
    path, remove = tmp_path / "model", atomic.remove
    path.mkdir()

    def refused(one):
        if "old-" in one.name:
            raise PermissionError(13, "denied", str(one))
        remove(one)

    monkeypatch.setattr(atomic, "remove", refused)
    _replaced(path, "new", monkeypatch, lambda: None)
    assert [one.name for one in path.iterdir()] == ["new"]


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("letter", ["n", "ü", "🙂", os.fsdecode(b"\xe9")])
def test_the_longest_names_can_be_written(letter, shared, tmp_path):
    count = (255 - len(".json")) // len(os.fsencode(letter))
    path = tmp_path / f"{letter * count}.json"
    with atomic.replacing(path, shared=shared) as partial:
        assert partial.suffix == ".json" and partial.name.startswith("partial-")
        partial.write_text("content", encoding="utf-8")
    assert [one.name for one in tmp_path.iterdir()] == [path.name]
    with pytest.raises(OSError, match="cannot be written: File name too long; shorten its name"):
        atomic.write(tmp_path / f"{letter * (count + 1)}.json", b"")
