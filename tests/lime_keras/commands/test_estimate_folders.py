"""The command over folders, again and again: what is looked for, kept, refused and replaced."""

import errno
import json
import shutil
from pathlib import Path

import clips
import live_scenes
import numpy as np
import pytest

from lime_keras.commands import estimate as estimate_cli
from lime_keras.estimate.estimator import Estimator
from lime_keras.io import locking, untrusted
from lime_keras.io.photo import read_srgb, write
from lime_keras.model import gloss_file
from lime_keras.render.commands import clone


def photo(seed=0, shape=(40, 50)):
    """A photo that brings its own mask: what is transparent is not the object."""
    pixels = np.random.default_rng(seed).uniform(size=(*shape, 4)).astype(np.float32)
    pixels[..., 3] = 0
    pixels[10:30, 10:40, 3] = 1
    return pixels


@pytest.fixture
def folder(tmp_path):
    """Photos of one name in a folder, in one below it, and twice in another."""
    root = tmp_path / "photos"
    for number, name in enumerate(("a.png", "one/a.png", "one/two/a.png", "one/two/a.tif")):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        write(root / name, photo(number))
    (root / ".hidden").mkdir()
    write(root / ".hidden" / "b.png", photo())
    return root


def run(*arguments, out):
    return estimate_cli.main([*map(str, arguments), "--only", "albedo", "--out", str(out)])


def lines(told):
    return [json.loads(line) for line in told.out.splitlines()]


def numbers(out):
    return sorted(path.relative_to(out).as_posix() for path in out.rglob("*.json"))


def test_folders_below_are_searched_and_kept(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert run(folder, out=out) == 0
    assert numbers(out) == ["a.json", "one/a.json", "one/two/a-2.json", "one/two/a.json"]
    told = lines(capsys.readouterr())
    assert len(told) == 4 and all(
        line["mask_coverage"] == pytest.approx(0.3, abs=0.01) for line in told
    )
    assert (out / "index.html").is_file()
    assert len((out / "materials.csv").read_text().splitlines()) == 5
    assert not (out / "one" / "index.html").exists()


def test_each_photo_may_have_its_folder(folder, tmp_path):
    out = tmp_path / "out"
    assert run(folder / "a.png", folder / "one", "--folders", out=out) == 0
    assert numbers(out) == ["a-2/a-2.json", "a/a.json", "two/a-2/a-2.json", "two/a/a.json"]
    assert {path.name for path in (out / "a").iterdir()} == {
        *("a.json", "a-mask.png", "a-preview.png")
    }


def test_a_second_command_is_refused_while_one_writes_there(folder, tmp_path, capsys):
    out = tmp_path / "out"
    with locking.lock_folder(out, "lime-estimate is writing into"):
        assert run(folder, out=out) == 1
        assert "another lime-estimate is writing into" in capsys.readouterr().err
        assert not any(out.iterdir())
    assert run(folder, out=out) == 0


def test_what_is_there_is_not_made_again(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert run(folder, out=out) == 0
    first = lines(capsys.readouterr())
    times = {path: path.stat().st_mtime_ns for path in out.rglob("a*")}
    write(folder / "new.png", photo(9))
    assert run(folder, out=out) == 0
    told = capsys.readouterr()
    assert "1 done, 4 there already, 0 failed" in told.err
    assert [line for line in lines(told) if line["photo"] != str(folder / "new.png")] == first
    assert {path: path.stat().st_mtime_ns for path in times} == times
    assert len((out / "materials.csv").read_text().splitlines()) == 6
    assert run(folder, out=out) == 0
    told = capsys.readouterr().err
    assert "0 done, 5 there already, 0 failed" in told and "a photo took" not in told


def test_the_progress_moves_with_each_photo(folder, tmp_path, monkeypatch):
    from lime_keras.estimate import batch

    moves = []

    class Bar(batch.tqdm):
        def __init__(self, **options):
            super().__init__(**options | {"disable": False})  # as at a terminal

        def update(self, n=1):
            moves.append(n)
            return super().update(n)

    monkeypatch.setattr(batch, "tqdm", Bar)
    (folder / "broken.png").write_bytes(b"")
    assert run(folder, out=tmp_path / "out") == 1
    assert moves == [1] * 5


def test_results_among_the_photos_are_no_photos(folder):
    for _ in range(2):
        assert run(folder, out=folder) == 0
        assert numbers(folder) == ["a.json", "one/a.json", "one/two/a-2.json", "one/two/a.json"]


def test_other_results_are_refused_before_anything_is_done(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert run(folder / "a.png", out=out) == 0
    before = (out / "a.json").read_text()
    capsys.readouterr()
    assert run(folder / "one" / "a.png", folder / "one" / "two", out=out) == 1
    told = capsys.readouterr()
    assert "a.json was made with another source: pass --overwrite" in told.err and not told.out
    assert numbers(out) == ["a.json"] and (out / "a.json").read_text() == before
    assert run(folder / "a.png", "--full-size", out=out) == 1
    assert "a.json was made with another --full-size: pass" in capsys.readouterr().err
    assert run(folder / "one" / "a.png", "--overwrite", out=out) == 0
    assert json.loads((out / "a.json").read_text())["photo"] == str(folder / "one" / "a.png")


def test_results_follow_the_calibration_of_gloss(folder, tiny_model, tmp_path, capsys):
    model = tmp_path / "mine"
    shutil.copytree(tiny_model, model / "model")
    arguments = (folder / "a.png", "--weights", model, "--engine", "keras")
    assert run(*arguments, out=tmp_path / "out") == 0
    assert run(*arguments, out=tmp_path / "out") == 0
    (model / "model" / gloss_file.NAME).write_text('{"even": 1.5, "slope": 2.5}', encoding="utf-8")
    assert run(*arguments, out=tmp_path / "out") == 1
    assert "was made with another weights" in capsys.readouterr().err
    assert run(*arguments, "--overwrite", out=tmp_path / "out") == 0


def test_a_photo_replaced_while_it_is_estimated_is_not_taken_for_it(tmp_path, capsys, monkeypatch):
    path, out = tmp_path / "a.png", tmp_path / "out"
    write(path, photo())
    estimate = Estimator.estimate

    def slow(self, image, mask):
        write(path, photo(1))
        return estimate(self, image, mask)

    monkeypatch.setattr(Estimator, "estimate", slow)
    assert run(path, out=out) == 0
    assert run(path, out=out) == 1
    assert "a.json was made with another source" in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_is_named(folder, tmp_path, monkeypatch, capsys):
    def refused(path, **options):
        raise OSError(errno.EROFS, "Read-only file system", str(path))

    monkeypatch.setattr(Path, "mkdir", refused)
    assert run(folder / "a.png", out=tmp_path / "out") == 1
    told = capsys.readouterr().err
    assert f"{tmp_path / 'out'} cannot be written: Read-only file system; pass a folder" in told


def test_a_page_of_someone_else_is_refused(folder, tmp_path, capsys):
    (tmp_path / "index.html").write_text("mine")
    assert run(folder / "a.png", "--overwrite", out=tmp_path) == 1
    assert "index.html is there, and not of lime-estimate" in capsys.readouterr().err
    assert (tmp_path / "index.html").read_text() == "mine" and not (tmp_path / "a.json").exists()


def test_what_was_done_before_an_interruption_is_in_the_gallery(folder, tmp_path, monkeypatch):
    from lime_keras.estimate import files

    write_pictures = files.write_pictures
    done: list[tuple] = []

    def interrupted(*arguments):
        if done:
            raise KeyboardInterrupt
        done.append(arguments)
        return write_pictures(*arguments)

    out = tmp_path / "out"
    monkeypatch.setattr(files, "write_pictures", interrupted)
    assert run(folder, out=out) == 130
    assert len((out / "materials.csv").read_text().splitlines()) == 2
    assert not list(out.rglob("partial-*"))


def test_the_diffuse_layer_alone(folder, tmp_path):
    out = tmp_path / "out"
    arguments = [str(folder / "a.png"), "--only", "diffuse", "--full-size", "--out", str(out)]
    assert estimate_cli.main(arguments) == 0
    layers = {"a-mask.png", "a-diffuse.png", "a-recomposed.png"}
    assert layers == {path.name for path in out.glob("a-*.png")} - {"a-preview.png"}
    assert read_srgb(out / "a-diffuse.png").shape == (40, 50, 3)


# Videos.


@pytest.fixture
def clip(tmp_path):
    return clips.write(tmp_path / "clip.mkv", np.stack([live_scenes.ball(64, 64)] * 3))


def estimate_video(clip, out, *arguments):
    return estimate_cli.main([str(clip), *arguments, "--out", str(out)])


def test_a_video_leaves_one_line_and_its_record(clip, tmp_path, capsys):
    out = tmp_path / "out"
    assert estimate_video(clip, out) == 0
    (line,) = lines(capsys.readouterr())
    assert line == json.loads((out / "clip.json").read_text())
    assert line["video"] == str(clip) and line["frames"] == 3
    assert {"clip.csv", "clip-overlay.mp4", "clip.json"} <= set(line["files"])
    assert set(line["files"]) == {path.name for path in out.glob("clip*")}
    assert bool(line["scenes"]) == (line["found"] > 0) == (out / "clip.gltf").exists()
    table = (out / "clip.csv").stat().st_mtime_ns
    assert estimate_video(clip, out) == 0
    assert lines(capsys.readouterr()) == [line]
    assert (out / "clip.csv").stat().st_mtime_ns == table


def test_another_videos_result_is_refused(clip, tmp_path, capsys):
    out = tmp_path / "out"
    assert estimate_video(clip, out) == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    clips.write(clip, np.stack([live_scenes.ball(64, 64, radius=0.5)] * 5))
    assert estimate_video(clip, out) == 1
    assert "clip.json was made with another source" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert estimate_video(clip, out, "--overwrite") == 0


def test_a_table_of_that_name_is_refused(clip, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "clip.csv").write_text("mine")
    assert estimate_video(clip, tmp_path / "out") == 1
    assert "clip.csv is there, and no part of an earlier result" in capsys.readouterr().err
    assert [path.read_text() for path in (tmp_path / "out").iterdir()] == ["mine"]


def test_a_broken_video_leaves_no_result(tmp_path, capsys):
    (tmp_path / "clip.mp4").write_bytes(b"nothing")
    assert estimate_video(tmp_path / "clip.mp4", tmp_path / "out") == 1
    assert "clip.mp4 cannot be read as a video" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--clone-onto", "MESH"], "--clone-onto is for photos, and"),
        (["--only", "diffuse"], "a video leaves no layers, so --only diffuse leaves nothing"),
    ],
    ids=["clone", "layers"],
)
def test_what_videos_cannot_give_is_refused(arguments, told, clip, tmp_path, capsys):
    mesh = tmp_path / "mesh.ply"
    mesh.touch()
    given = [str(mesh) if argument == "MESH" else argument for argument in arguments]
    assert clone.main([str(clip), *given, "--out", str(tmp_path / "out")]) == 1
    assert told in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_new_photo_beside_a_finished_one_of_its_name_is_done(tmp_path, capsys):
    """It comes first in the folder, but the finished one keeps its name, and is not made again."""
    folder, out = tmp_path / "photos", tmp_path / "out"
    write(folder / "a.png", photo(0))
    assert run(folder, out=out) == 0
    before = (out / "a.json").read_bytes(), (out / "a.json").stat().st_mtime_ns
    write(folder / "a.exr", photo(1))
    write(folder / "b.png", photo(2))
    capsys.readouterr()
    assert run(folder, out=out) == 0
    assert ((out / "a.json").read_bytes(), (out / "a.json").stat().st_mtime_ns) == before
    told = {Path(line["photo"]).name for line in lines(capsys.readouterr())}
    assert told == {"a.png", "a.exr", "b.png"}
    assert json.loads((out / "a-2.json").read_text())["photo"].endswith("a.exr")


def test_one_mask_for_two_photos_is_refused_before_anything_is_done(tmp_path, capsys):
    masks = tmp_path / "masks"
    for name in ("one/a.png", "two/a.png"):
        write(tmp_path / "photos" / name, photo()[..., :3])
    write(masks / "a.png", photo()[..., 3:])
    assert run(tmp_path / "photos", "--mask", masks, out=tmp_path / "out") == 1
    assert "could be meant for" in capsys.readouterr().err and not (tmp_path / "out").exists()
    for name in ("one/a.png", "two/a.png"):
        write(masks / name, photo()[..., 3:])
    assert run(tmp_path / "photos", "--mask", masks, out=tmp_path / "out") == 0


def test_a_video_that_cannot_be_read_leaves_the_others(clip, tmp_path, monkeypatch, capsys):
    other = tmp_path / "a.mkv"
    other.write_bytes(clip.read_bytes())
    sha256 = untrusted.sha256

    def locked(path):
        if Path(path) == other:
            raise PermissionError(13, "Permission denied", str(path))
        return sha256(path)

    monkeypatch.setattr(untrusted, "sha256", locked)
    out = tmp_path / "out"
    assert estimate_cli.main([str(other), str(clip), "--out", str(out)]) == 1
    assert f"Permission denied: '{other}'" in capsys.readouterr().err
    assert (out / "clip.json").is_file() and not (out / "a.json").exists()
