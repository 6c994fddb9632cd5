"""What is kept is whole, and reused exactly while what it follows from is the same."""

import functools
import json

import numpy as np
import pytest

from lime_keras.eval.store import Store, files_of, package_versions, sha256, size


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
    assert Store(tmp_path).value("x/y", key, make, code="c") == {"calls": 1}
    assert Store(tmp_path).value("x/y", key, make, code="c") == {"calls": 1}
    assert Store(tmp_path).value("x/y", key | {"more": 0}, make, code="c") == {"calls": 2}
    assert Store(tmp_path).value("x/y", key, make, code="c") == {"calls": 3}
    [kept] = (tmp_path / "x").iterdir()
    assert json.loads(kept.read_text(encoding="utf-8"))["result"] == {"calls": 3}


def test_the_first_answer_is_what_later_ones_will_be(tmp_path):
    first = Store(tmp_path).value("x", {}, lambda: {"pair": (1, 2)}, code="c")
    assert first == Store(tmp_path).value("x", {}, Counted(), code="c") == {"pair": [1, 2]}


@pytest.mark.parametrize("text", ["", "{", "\x00"])
def test_a_record_that_cannot_be_read_is_made_again(tmp_path, text):
    make = Counted()
    Store(tmp_path).value("x", {}, make, code="c")
    (tmp_path / "x.json").write_text(text, encoding="utf-8")
    assert Store(tmp_path).value("x", {}, make, code="c") == {"calls": 2}


def test_a_number_that_is_none_is_not_kept(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        Store(tmp_path).value("x", {}, lambda: {"error": float("nan")}, code="c")
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_made_once_for_each_key(tmp_path):
    make = Counted()
    for key, calls in (({"a": 1}, 1), ({"a": 1}, 1), ({"a": 2}, 2), ({"a": 1}, 3)):
        path = Store(tmp_path).file("models/x.onnx", key, make, code="c")
        assert path.name == "x.onnx" and path.read_text(encoding="utf-8") == str(calls)
    path.unlink()
    assert Store(tmp_path).file("models/x.onnx", {"a": 1}, make, code="c").is_file()
    assert make.calls == 4


def test_a_folder_replaces_the_last_one_whole(tmp_path):
    def write(name):
        def make(path):
            path.mkdir()
            (path / name).write_bytes(b"12345")

        return make

    store = Store(tmp_path)
    store.file("model", {"a": 1}, write("old"), code="c")
    path = store.file("model", {"a": 2}, write("new"), code="c")
    assert [file.name for file in path.iterdir()] == ["new"]
    assert files_of(path) == [path / "new"] == files_of(path / "new")
    assert size(path) == size(path / "new") == 5


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_an_interruption_leaves_the_last_whole_one(tmp_path, error):
    def interrupted(path=None):
        if path is not None:
            path.mkdir()
            (path / "half").write_text("half", encoding="utf-8")
        raise error

    store, make = Store(tmp_path), Counted()
    store.value("x", {"a": 1}, make, code="c")
    path = store.file("y", {"a": 1}, make, code="c")
    for attempt in (
        lambda: store.value("x", {"a": 2}, interrupted, code="c"),
        lambda: store.file("y", {"a": 2}, interrupted, code="c"),
    ):
        with pytest.raises(error):
            attempt()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["x.json", "y", "y.json"]
    assert store.value("x", {"a": 1}, interrupted, code="c") == {"calls": 1}
    assert store.file("y", {"a": 1}, interrupted, code="c") == path


def test_no_record_vouches_for_a_file_that_was_exchanged(tmp_path, monkeypatch):
    """Stopped between the new file and its record, neither key takes the file for its own."""
    store, make = Store(tmp_path), Counted()
    store.file("y", {"a": 1}, make, code="c")

    def stopped(path, content):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("lime_keras.eval.store._write", stopped)
        with pytest.raises(KeyboardInterrupt):
            store.file("y", {"a": 2}, make, code="c")
    assert store.file("y", {"a": 1}, make, code="c").read_text(encoding="utf-8") == "3"


def test_a_hash_tells_files_and_their_order_apart(tmp_path):
    first, second = tmp_path / "1", tmp_path / "2"
    first.write_bytes(b"ab")
    second.write_bytes(b"c")
    hashes = {sha256(first), sha256(first, second), sha256(second, first)}
    first.write_bytes(b"a")
    second.write_bytes(b"bc")
    assert len(hashes | {sha256(first, second)}) == 4


def _arrays(calls):
    calls.append(len(calls) + 1)
    return {"calls": np.array(calls), "names": np.array([b"a", b"bc"]), "text": np.array("text")}


def test_arrays_are_made_once_for_each_key_and_anew_where_they_are_damaged(tmp_path):
    calls: list[int] = []
    make = functools.partial(_arrays, calls)
    for key in ({"a": 1}, {"a": 1}):
        found = Store(tmp_path).arrays("x", key, make, code="c")
        assert found.keys() == {"calls", "names", "text"} and found["calls"].tolist() == [1]
        assert found["names"].tolist() == [b"a", b"bc"] and str(found["text"]) == "text"
    assert Store(tmp_path).arrays("x", {"a": 2}, make, code="c")["calls"].tolist() == [1, 2]
    path = tmp_path / "x.npz"
    for kept in (0, 10, path.stat().st_size - 10):
        path.write_bytes(path.read_bytes()[:kept])
        assert Store(tmp_path).arrays("x", {"a": 2}, make, code="c")["calls"].tolist() == calls
    assert len(calls) == 5 and not list(tmp_path.glob("partial-*"))


# What the code decides.


def test_other_code_makes_all_anew(tmp_path):
    make = Counted()
    for code, calls in (("a", 1), ("a", 1), ("b", 3), ("b", 3), ("a", 5)):
        Store(tmp_path).value("x", {}, make, code=code)
        Store(tmp_path).file("y", {}, make, code=code)
        assert make.calls == calls + 1


def test_other_versions_of_what_computes_are_in_every_key(tmp_path, monkeypatch):
    make = Counted()
    Store(tmp_path).value("x", {}, make, code="c")
    versions = package_versions()
    assert versions.keys() >= {"tensorflow", "keras", "numpy", "onnxruntime", "OpenImageIO"}
    assert not versions.keys() & {"ruff", "pytest", "ray"}
    newer = versions | {"onnxruntime": "99"}
    monkeypatch.setattr("lime_keras.eval.store.package_versions", lambda: newer)
    assert Store(tmp_path).value("x", {}, make, code="c") == {"calls": 2}


def test_what_an_earlier_version_kept_is_made_again(tmp_path):
    """Its records hold no code."""
    earlier = {"depends_on": {"a": 1}, "result": {"calls": 9}}
    (tmp_path / "x.json").write_text(json.dumps(earlier), encoding="utf-8")
    assert Store(tmp_path).value("x", {"a": 1}, Counted(), code="c") == {"calls": 1}
