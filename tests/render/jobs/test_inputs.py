"""The user's files, judged before rendering: every reason told, nothing read twice."""

import dataclasses
import functools
import os
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import OpenImageIO as oiio
import pytest
import trimesh
from written_pictures import write

from lime_keras.render.jobs import inputs, resuming

write_image = functools.partial(write, kind=oiio.FLOAT)


def in_turn(function, items):
    return [function(item) for item in items]


@pytest.fixture
def files(tmp_path):
    """By kind, a few usable files."""
    trimesh.creation.icosphere(subdivisions=1).export(tmp_path / "ball.ply")
    trimesh.creation.box().export(tmp_path / "box.obj")
    write_image(tmp_path / "map.exr", np.ones((8, 16, 3)))
    write(tmp_path / "photo.png", np.full((20, 20, 3), 0.5))
    names = {
        "shapes": ["ball.ply", "box.obj"],
        "environments": ["map.exr"],
        "backgrounds": ["photo.png"],
    }
    return {kind: [tmp_path / name for name in listed] for kind, listed in names.items()}


def spoil(path):
    path.write_bytes(b"nothing")
    return path


def test_usable_files_are_found_usable(files, tmp_path):
    findings = inputs.inspect(files, None, in_turn)
    assert [f.name for f in findings["shapes"]] == ["ball.ply", "box.obj"]
    assert all(len(f.sha256) == 64 and f.size > 0 for found in findings.values() for f in found)
    assert inputs.usable(files, findings) == files
    assert inputs.repairs(findings) == []
    resuming.write_json(tmp_path / "inputs.json", inputs.recorded(findings))
    assert inputs.read(tmp_path / "inputs.json") == findings


@pytest.mark.parametrize(
    "wrong", [{"name": {}}, {"sha256": 5}, {"problem": [1]}, {"size": "3"}, {"notes": [None]}]
)
def test_findings_of_other_types_are_refused(wrong, tmp_path):
    path = tmp_path / "inputs.json"
    sound = inputs.Finding("a.obj", "0" * 64, 3, 5)
    findings = {"shapes": [dataclasses.replace(sound, **wrong)]}
    resuming.write_json(path, inputs.recorded(findings))
    with pytest.raises(ValueError, match=r"inputs\.json cannot be read as findings: .*; remove it"):
        inputs.read(path)


def test_all_unusable_files_are_refused_together(files):
    for path in (files["shapes"][0], files["environments"][0], files["backgrounds"][0]):
        spoil(path)
    findings = inputs.inspect(files, None, in_turn)
    with pytest.raises(ValueError, match="--unusable skip") as refusal:
        inputs.usable(files, findings)
    told = str(refusal.value).splitlines()
    assert told[0] == "3 files cannot be used:" and len(told) == 5
    starts = ["shapes: ball.ply: ", "environments: map.exr: ", "backgrounds: photo.png: "]
    for line, start in zip(told[1:4], starts, strict=True):
        assert line.strip().startswith(f"{start}cannot be read")


def test_unusable_files_are_skipped_with_their_reasons(files):
    spoil(files["shapes"][0])
    findings = inputs.inspect(files, None, in_turn)
    assert inputs.usable(files, findings, skip=True)["shapes"] == files["shapes"][1:]
    problems = inputs.unusable(findings)
    assert list(problems["shapes"]) == ["ball.ply"] and problems["environments"] == {}
    assert "cannot be read as a mesh" in problems["shapes"]["ball.ply"]
    spoil(files["shapes"][1])
    with pytest.raises(ValueError, match=r"none of the split's shapes can be used:\n  shapes:"):
        inputs.usable(files, inputs.inspect(files, None, in_turn), skip=True)


def test_a_kind_that_is_built_in_needs_no_files(files):
    files["environments"] = []
    assert inputs.usable(files, inputs.inspect(files, None, in_turn)) == files


def test_a_long_list_is_cut(tmp_path):
    files = {"shapes": [spoil(tmp_path / f"{k:03d}.ply") for k in range(50)]}
    with pytest.raises(ValueError, match="50 files") as refusal:
        inputs.usable(files, inputs.inspect(files, None, in_turn))
    assert "019.ply" in str(refusal.value) and "020.ply" not in str(refusal.value)
    assert "and 30 more" in str(refusal.value)
    del files["shapes"][20:]
    with pytest.raises(ValueError, match="20 files") as refusal:
        inputs.usable(files, inputs.inspect(files, None, in_turn))
    assert "019.ply" in str(refusal.value) and " more" not in str(refusal.value)


@pytest.mark.parametrize(
    ("kind", "name", "make", "reason"),
    [
        ("shapes", "gone.ply", None, "cannot be read as an input (No such file"),
        ("shapes", "empty.obj", lambda p: p.write_text("# nothing"), "holds no faces"),
        (
            "shapes",
            "wire.stl",
            lambda p: trimesh.creation.box((1e-3, 1e-3, 1)).export(p),
            "covers less than 2%",
        ),
        ("environments", "square.exr", lambda p: write_image(p, np.ones((8, 8, 3))), "is 8x8"),
        ("environments", "two.exr", lambda p: write_image(p, np.ones((8, 16, 2))), "channels R, G"),
        ("environments", "dark.exr", lambda p: write_image(p, np.zeros((8, 16, 3))), "is black"),
        ("backgrounds", "dot.png", lambda p: write_image(p, np.ones((1, 1, 3))), "is 1x1"),
        ("backgrounds", "text.jpg", lambda p: p.write_text("hello"), "cannot be read as a picture"),
    ],
)
def test_reasons_are_told_without_the_folder(tmp_path, kind, name, make, reason):
    if make:
        make(tmp_path / name)
    finding = inputs.check(kind, tmp_path / name)
    assert finding.name == name and reason in finding.problem
    assert str(tmp_path) not in finding.problem


@pytest.mark.parametrize(
    ("fails", "error", "reason"),
    [
        ((inputs.untrusted, "sha256"), OSError(5, "Input/output error"), "cannot be read: Input/"),
        ((inputs, "_notes"), MemoryError(), "is too large for this machine's memory."),
    ],
    ids=["disk", "memory"],
)
def test_what_the_machine_lacks_is_told_with_the_file(fails, error, reason, tmp_path, monkeypatch):
    def fail(*_):
        raise error

    trimesh.creation.box().export(tmp_path / "box.ply")
    monkeypatch.setattr(*fails, fail)
    assert inputs.check("shapes", tmp_path / "box.ply").problem.startswith(reason)


def test_a_name_that_is_no_text_is_told(tmp_path):
    path = tmp_path / "caf\udce9.obj"
    trimesh.creation.box().export(tmp_path / "box.obj")
    (tmp_path / "box.obj").rename(path)
    findings = inputs.inspect({"shapes": [path]}, None, in_turn)
    assert "not UTF-8" in findings["shapes"][0].problem
    resuming.write_json(tmp_path / "inputs.json", inputs.recorded(findings))
    assert inputs.read(tmp_path / "inputs.json") == findings


def test_what_was_repaired_is_told_once_for_each_file(files, tmp_path):
    texels = np.ones((8, 16, 3))
    texels[0, :5] = np.nan
    write_image(files["environments"][0], texels)
    picture = np.full((20, 20, 3), 0.5)
    picture[0, :3] = np.inf
    files["backgrounds"] = [write_image(tmp_path / "photo.tif", picture)]
    assert inputs.repairs(inputs.inspect(files, None, in_turn)) == [
        "environments: map.exr: repaired 5 texels that were negative or not finite",
        "backgrounds: photo.tif: 3 pixels that were not finite are black",
    ]


# ---- going on with a split -------------------------------------------------------------------


class Counted:
    """Runs in turn, and remembers what it was asked to read."""

    def __init__(self):
        self.names = []

    def __call__(self, function, items):
        self.names += [path.name for _, path in items]
        return in_turn(function, items)


def test_nothing_unchanged_is_read_again(files):
    findings = inputs.inspect(files, None, in_turn)
    run = Counted()
    assert inputs.inspect(files, findings, run) == findings and run.names == []


def test_a_file_copied_anew_is_read_but_not_refused(files):
    findings = inputs.inspect(files, None, in_turn)
    path = files["shapes"][0]
    path.write_bytes(path.read_bytes())
    run = Counted()
    again = inputs.inspect(files, findings, run)
    assert run.names == ["ball.ply"]
    assert again["shapes"][0].sha256 == findings["shapes"][0].sha256
    assert inputs.inspect(files, again, run) == again and run.names == ["ball.ply"]


def test_a_changed_file_is_refused_by_name(files):
    findings = inputs.inspect(files, None, in_turn)
    trimesh.creation.box((1, 2, 3)).export(files["shapes"][1])
    with pytest.raises(ValueError, match=r"box\.obj changed since the split was begun"):
        inputs.inspect(files, findings, in_turn)


def test_files_that_come_or_go_are_refused_by_name(files, tmp_path):
    findings = inputs.inspect(files, None, in_turn)
    fewer = files | {"shapes": files["shapes"][1:]}
    with pytest.raises(ValueError, match=r"ball\.ply came or went since the split was begun"):
        inputs.inspect(fewer, findings, in_turn)
    with pytest.raises(ValueError, match=r"ball\.ply came or went since the split was begun"):
        inputs.inspect(files, inputs.inspect(fewer, None, in_turn), in_turn)


@pytest.mark.parametrize("text", ["{", "[]", '{"shapes": [{"notes": []}]}', '{"shapes": [1]}'])
def test_findings_that_were_garbled_are_refused_by_name(tmp_path, text):
    assert inputs.read(tmp_path / "inputs.json") is None
    (tmp_path / "inputs.json").write_text(text)
    with pytest.raises(ValueError, match=r"inputs\.json cannot be read as findings"):
        inputs.read(tmp_path / "inputs.json")


def test_other_processes_can_judge(files):
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        findings = inputs.inspect(files, None, lambda f, items: list(pool.map(f, items)))
    assert findings == pickle.loads(pickle.dumps(inputs.inspect(files, None, in_turn)))


@pytest.mark.parametrize("kind, name", [("shapes", "a.obj"), ("environments", "a.exr")])
def test_a_pipe_is_told_and_not_waited_for(kind, name, tmp_path):
    os.mkfifo(tmp_path / name)
    finding = inputs.check(kind, tmp_path / name)
    assert finding.problem == "cannot be read as an input, it is a pipe: pass a file"
