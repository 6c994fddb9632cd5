"""`lime-render`: what it prints, and how it ends."""

import json
import subprocess
import sys

import numpy as np
import OpenImageIO as oiio
import pytest

from lime_keras.render import cli, shards, variants
from lime_keras.render.workers import _THREAD_VARIABLES


@pytest.fixture
def render(monkeypatch, capsys, mitsuba_choice, tmp_path):
    """Runs the command; gives exit status, standard output and standard error."""
    monkeypatch.setattr(variants, "choose", lambda: mitsuba_choice)
    for name in _THREAD_VARIABLES:
        monkeypatch.setenv(name, "1")

    def run(*options):
        status = cli.main([str(tmp_path / "corpus"), "--split", "train", *map(str, options)])
        return status, *capsys.readouterr()

    return run


def test_the_options_reach_the_renderer(render, monkeypatch, tmp_path):
    calls = []

    def render_split(out, description, choice, *, workers, on_room, on_example):
        on_room(1, 2)
        on_example(0, 9)
        on_example(9, 9)
        calls.append((out, description, workers))
        failure = {"index": 4, "attempt": 0, "error": "the object covers 0.1% of the image"}
        return {"examples": 9, "failures": [failure]}

    monkeypatch.setattr(shards, "render_split", render_split)
    monkeypatch.chdir(tmp_path)
    status, printed, progress = render(
        *("--count", 9, "--seed", 3, "--size", 64, "--shard-size", 4, "--shading", "literal"),
        *("--shapes", "meshes", "--workers", 8),
    )
    assert status == 0 and printed == f"9 examples in {tmp_path / 'corpus' / 'train'}\n"
    assert "replaced: example 4: the object covers" in progress
    [(out, description, workers)] = calls
    assert out == tmp_path / "corpus" and workers == 8
    expected = ("train", 9, 3, 64, 4, "literal", str(tmp_path / "meshes"), None, None)
    assert tuple(vars(description).values())[:-1] == expected


@pytest.mark.parametrize("kind", ["shapes", "environments", "backgrounds"])
@pytest.mark.parametrize("exists", [True, False])
def test_an_unusable_folder_is_told_by_name(render, tmp_path, kind, exists):
    folder = tmp_path / "nothing-here"
    if exists:
        folder.mkdir()
    status, printed, errors = render("--count", 1, f"--{kind}", folder)
    assert status == 1 and not printed
    assert errors.splitlines()[-1].startswith(f"error: {folder} ")
    assert "Traceback" not in errors
    assert not (tmp_path / "corpus").exists()  # not claimed: the mended command may follow


def test_a_broken_mesh_is_told_by_name(render, tmp_path):
    """Found by a worker, in another process."""
    for name in ("meshes", "maps"):
        (tmp_path / name).mkdir()
    for number in range(2):
        (tmp_path / "meshes" / f"broken{number}.ply").write_bytes(b"ply\nnothing")
        image = oiio.ImageBuf(oiio.ImageSpec(128, 64, 1, oiio.HALF))
        image.set_pixels(oiio.ROI(), np.ones((64, 128, 1), np.float32))
        assert image.write(str(tmp_path / "maps" / f"{number}.exr"))
    status, printed, errors = render(
        *("--count", 1, "--size", 64, "--workers", 1),
        *("--shapes", tmp_path / "meshes", "--environments", tmp_path / "maps"),
    )
    assert status == 1 and not printed
    message = errors.splitlines()[-1]
    assert message.startswith("error: ") and ".ply" in message and "broken" in message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--count", "0"], "0 is not at least 1"),
        (["--count", "1", "--seed", "-1"], "-1 is not in 0"),
        (["--count", "1", "--size", "100"], "100 is not a multiple of 32"),
        (["--count", "1", "--size", "large"], "invalid"),
        (["--count", "1", "--split", "valid"], "invalid choice"),
        ([], "--count"),
    ],
)
def test_wrong_usage_ends_with_2(capsys, options, message):
    with pytest.raises(SystemExit) as stop:
        cli.main(["corpus", "--split", "train", *options])
    assert stop.value.code == 2
    assert message in capsys.readouterr().err


@pytest.mark.slow
def test_built_in_shapes_and_rooms_render_alike_with_one_and_two_workers(tmp_path):
    digests = []
    for workers in ("1", "2"):
        out = tmp_path / workers
        command = [sys.executable, "-c", "import sys; from lime_keras.render import cli; "]
        command[-1] += "sys.exit(cli.main())"
        options = ["--split", "test", "--count", "6", "--shard-size", "2", "--size", "64"]
        answer = subprocess.run(
            [*command, str(out), *options, "--workers", workers], capture_output=True, text=True
        )
        assert answer.returncode == 0, answer.stderr
        assert answer.stdout == f"6 examples in {out / 'test'}\n"
        # By their pixels: the files hold the time of writing.
        rooms = {
            path.name: oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT).tobytes()
            for path in (out / "test" / "rooms").iterdir()
        }
        manifest = json.loads((out / "test" / "manifest.json").read_text(encoding="utf-8"))
        assert sorted(rooms) == manifest["lights"] and len(rooms) == 12
        digests.append((manifest["sha256"], rooms))
    assert digests[0] == digests[1]
