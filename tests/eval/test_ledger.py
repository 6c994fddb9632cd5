"""What is kept is whole, and reused exactly while what it follows from is the same."""

import json

import pytest

from lime_keras.eval.ledger import Ledger, sha256, size


class Counted:
    """A function that counts its calls and answers how many there were."""

    def __init__(self):
        self.calls = 0

    def __call__(self, path=None):
        self.calls += 1
        if path is not None:
            path.write_text(str(self.calls), encoding="utf-8")
        return {"calls": self.calls}


@pytest.mark.parametrize("key", [{"a": 1}, {"a": (1, 2)}, {"a": {"b": None}}, {}])
def test_a_value_is_made_once_for_each_key(tmp_path, key):
    make = Counted()
    assert Ledger(tmp_path).value("x/y", key, make) == {"calls": 1}
    assert Ledger(tmp_path).value("x/y", key, make) == {"calls": 1}
    assert Ledger(tmp_path).value("x/y", key | {"more": 0}, make) == {"calls": 2}
    assert Ledger(tmp_path).value("x/y", key, make) == {"calls": 3}
    [kept] = (tmp_path / "x").iterdir()
    assert json.loads(kept.read_text(encoding="utf-8"))["result"] == {"calls": 3}


def test_the_first_answer_is_what_later_ones_will_be(tmp_path):
    first = Ledger(tmp_path).value("x", {}, lambda: {"pair": (1, 2)})
    assert first == Ledger(tmp_path).value("x", {}, Counted()) == {"pair": [1, 2]}


@pytest.mark.parametrize("text", ["", "{", "\x00"])
def test_a_record_that_cannot_be_read_is_made_again(tmp_path, text):
    make = Counted()
    Ledger(tmp_path).value("x", {}, make)
    (tmp_path / "x.json").write_text(text, encoding="utf-8")
    assert Ledger(tmp_path).value("x", {}, make) == {"calls": 2}


def test_a_number_that_is_none_is_not_kept(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        Ledger(tmp_path).value("x", {}, lambda: {"error": float("nan")})
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_made_once_for_each_key(tmp_path):
    make = Counted()
    for key, calls in (({"a": 1}, 1), ({"a": 1}, 1), ({"a": 2}, 2), ({"a": 1}, 3)):
        path = Ledger(tmp_path).file("models/x.onnx", key, make)
        assert path.name == "x.onnx" and path.read_text(encoding="utf-8") == str(calls)
    path.unlink()
    assert Ledger(tmp_path).file("models/x.onnx", {"a": 1}, make).is_file()
    assert make.calls == 4


def test_a_folder_replaces_the_last_one_whole(tmp_path):
    def write(name):
        def make(path):
            path.mkdir()
            (path / name).write_bytes(b"12345")

        return make

    ledger = Ledger(tmp_path)
    ledger.file("model", {"a": 1}, write("old"))
    path = ledger.file("model", {"a": 2}, write("new"))
    assert [file.name for file in path.iterdir()] == ["new"]
    assert size(path) == size(path / "new") == 5


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_an_interruption_leaves_the_last_whole_one(tmp_path, error):
    def interrupted(path=None):
        if path is not None:
            path.mkdir()
            (path / "half").write_text("half", encoding="utf-8")
        raise error

    ledger, make = Ledger(tmp_path), Counted()
    ledger.value("x", {"a": 1}, make)
    path = ledger.file("y", {"a": 1}, make)
    for attempt in (
        lambda: ledger.value("x", {"a": 2}, interrupted),
        lambda: ledger.file("y", {"a": 2}, interrupted),
    ):
        with pytest.raises(error):
            attempt()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["x.json", "y", "y.json"]
    assert ledger.value("x", {"a": 1}, interrupted) == {"calls": 1}
    assert ledger.file("y", {"a": 1}, interrupted) == path


def test_no_record_vouches_for_a_file_that_was_exchanged(tmp_path, monkeypatch):
    """Stopped between the new file and its record, neither key takes the file for its own."""
    ledger, make = Ledger(tmp_path), Counted()
    ledger.file("y", {"a": 1}, make)

    def stopped(path, content):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("lime_keras.eval.ledger._write", stopped)
        with pytest.raises(KeyboardInterrupt):
            ledger.file("y", {"a": 2}, make)
    assert ledger.file("y", {"a": 1}, make).read_text(encoding="utf-8") == "3"


def test_a_hash_tells_files_and_their_order_apart(tmp_path):
    first, second = tmp_path / "1", tmp_path / "2"
    first.write_bytes(b"ab")
    second.write_bytes(b"c")
    hashes = {sha256(first), sha256(first, second), sha256(second, first)}
    first.write_bytes(b"a")
    second.write_bytes(b"bc")
    assert len(hashes | {sha256(first, second)}) == 4
