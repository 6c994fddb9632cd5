"""Files are whole or not there."""

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
