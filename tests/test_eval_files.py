"""Files are whole or not there."""

import pytest

from lime_keras.eval import files


def test_a_failing_write_leaves_the_old_file(tmp_path, monkeypatch):
    (tmp_path / "metrics.json").write_text("old", encoding="utf-8")

    def full(*_):
        raise OSError("no space left")

    monkeypatch.setattr(files.os, "replace", full)
    with pytest.raises(OSError, match="no space"):
        files.write(tmp_path / "metrics.json", b"new")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


def test_folders_are_made(tmp_path):
    files.write(tmp_path / "a" / "b.txt", b"content")
    assert (tmp_path / "a" / "b.txt").read_bytes() == b"content"
