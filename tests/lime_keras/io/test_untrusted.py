"""The door for files that come in: kinds, sizes, JSON, and whatever readers raise."""

import os
import socket

import pytest

from lime_keras.io import untrusted


def test_a_file_passes(tmp_path):
    (tmp_path / "ünicode.jpg").touch()
    (tmp_path / "link").symlink_to("ünicode.jpg")
    untrusted.check(tmp_path / "ünicode.jpg", "a picture")
    untrusted.check(tmp_path / "link", "a picture")


def test_what_is_no_file_is_told_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket"))
    (tmp_path / "gone").symlink_to("nowhere")
    (tmp_path / "loop").symlink_to("loop")
    for name, told in (
        ("pipe", "it is a pipe: pass a file"),
        ("socket", "it is a socket: pass a file"),
        (".", "it is a folder: pass a file"),
        ("/dev/zero", "it is a device: pass a file"),
        ("gone", r"\(No such file or directory\): check the path"),
        ("loop", r"\(Too many levels of symbolic links\): check the path"),
        ("n" * 300, r"\(File name too long\): check the path"),
        ("null\0byte", "check the path"),
    ):
        with pytest.raises(ValueError, match=f"cannot be read as a clip.*{told}"):
            untrusted.check(tmp_path / name, "a clip")


@pytest.mark.parametrize("size, told", [((10, 11, 4), None), ((11, 10, 3), None), ((11, 11, 1), 0)])
def test_the_largest_size_passes(size, told, tmp_path):
    if told is None:
        untrusted.check_size(tmp_path, *size, largest=110)
    else:
        with pytest.raises(ValueError, match="has 11×11 pixels, more than"):
            untrusted.check_size(tmp_path, *size, largest=110)
    with pytest.raises(ValueError, match="has 5 channels of 11×10 pixels"):
        untrusted.check_size(tmp_path, 11, 10, 5, largest=110)


def test_a_readers_lines_become_one(tmp_path):
    path = tmp_path / "a.exr"
    for words in (f"{path} is\ndamaged:\n  copy it", "is\ndamaged"):
        with pytest.raises(ValueError) as caught, untrusted.naming(path, "a picture"):
            raise ValueError(words)
        assert str(path) in str(caught.value) and "is damaged" in str(caught.value)


def test_an_error_that_names_the_file_keeps_its_words(tmp_path):
    path = tmp_path / "p.jpg"
    with pytest.raises(ValueError, match=r"p\.jpg is black$"), untrusted.naming(path, "a picture"):
        raise ValueError(f"{path} is black")
    with pytest.raises(KeyboardInterrupt), untrusted.naming(path, "a picture"):
        raise KeyboardInterrupt
    with (
        pytest.raises(ValueError, match=r"p\.jpg cannot be read as a picture: one two …") as told,
        untrusted.naming(path, "a picture"),
    ):
        raise IndexError("one\n  two … " + 10_000 * "x")
    assert len(str(told.value)) < len(str(path)) + 300


@pytest.mark.parametrize(
    "content, told",
    [
        ("", "Expecting value"),
        ("[" * 200_000, "nested too deeply"),
        ('{"a":' * 200_000, "nested too deeply"),
        ("[]", "no JSON object"),
        ("3", "no JSON object"),
        ("null", "no JSON object"),
        (b"\xff\xfe{}", "decode"),
    ],
)
def test_json_that_is_none_or_of_another_kind(content, told, tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ValueError, match=told):
        untrusted.read_json(path)


def test_json_that_is_missing_or_a_pipe_or_huge(tmp_path):
    os.mkfifo(tmp_path / "pipe.json")
    with (tmp_path / "huge.json").open("wb") as file:
        file.truncate(untrusted.LARGEST_JSON + 1)  # takes no room: it is all hole
    for name, told in (("none", "No such file"), ("pipe", "a pipe"), ("huge", "more than 671")):
        with pytest.raises(ValueError, match=told):
            untrusted.read_json(tmp_path / f"{name}.json")
