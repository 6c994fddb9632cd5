"""The command: files and folders in, files out, and what it says about those that fail."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import clips
import full_disk
import numpy as np
import onnx
import onnx_files
import OpenImageIO as oiio
import pytest

from lime_keras import Estimator, console
from lime_keras.commands import estimate as estimate_cli
from lime_keras.io.photo import read_srgb, write

GALLERY = {"index.html", "materials.csv"}


def photo(shape, seed=0):
    return np.random.default_rng(seed).uniform(size=(*shape, 3)).astype(np.float32)


@pytest.fixture
def folder(tmp_path):
    """Two photos of different sizes, and a text."""
    (tmp_path / "photos").mkdir()
    write(tmp_path / "photos" / "a.png", photo((40, 90)))
    write(tmp_path / "photos" / "b.png", photo((33, 20), seed=1))
    (tmp_path / "photos" / "notes.txt").write_text("none of them")
    return tmp_path / "photos"


def run(*arguments, weights_folder, out):
    return estimate_cli.main(
        [*map(str, arguments), "--weights", str(weights_folder), "--out", str(out)]
    )


def test_a_folder_is_all_its_pictures(folder, tiny_model, tmp_path, capsys):
    assert run(folder, weights_folder=tiny_model, out=tmp_path / "out") == 0
    written = {path.name for path in (tmp_path / "out").iterdir()}
    names = ("json", "mtl", "gltf")
    assert {f"{name}.{kind}" for name in "ab" for kind in names} <= written
    assert not any(name.startswith("partial-") for name in written)
    told = capsys.readouterr()
    assert told.out.count('"photo"') == 2
    assert "2 done, 0 failed, 0 without an object" in told.err
    assert "(segmentation, specular, mirror, exponent, albedo)" in told.err


def test_at_a_terminal_a_person_is_answered(folder, tiny_model, tmp_path, capsys, monkeypatch):
    """In words, warnings among them; in JSON if asked for; also of a result that is there."""
    photo, out = folder / "a.png", tmp_path / "out"
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("NO_COLOR", "1")
    for _ in range(2):
        assert run(photo, weights_folder=tiny_model, out=out) == 0
        told = capsys.readouterr()
        first, material, *others = told.out.splitlines()
        assert first == str(photo) and material.startswith("  #") and ", s " in material
        assert any(line.startswith("  ! ") for line in others)
        assert others[-1].startswith(f"  {out}{os.sep}: a-preview.png, a.gltf")
        assert "warning: " not in told.err
    assert run(photo, "--json", weights_folder=tiny_model, out=out) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers == json.loads((out / "a.json").read_text(encoding="utf-8"))


def test_files_that_fail_are_told_and_the_rest_is_done(folder, tiny_model, tmp_path, capsys):
    (folder / "broken.jpg").write_bytes(b"\xff\xd8\xff\xe0 and then nothing")
    (folder / "empty.png").write_bytes(b"")
    write(folder / "dot.png", photo((1, 1)))
    given = (folder, folder / "notes.txt", folder / "none.png")
    assert run(*given, weights_folder=tiny_model, out=tmp_path / "out") == 1
    errors = [line for line in capsys.readouterr().err.splitlines() if "error: " in line]
    for name in ("broken.jpg", "empty.png", "dot.png", "notes.txt", "none.png"):
        assert sum(str(folder / name) in line for line in errors) == 1, name
    assert {path.stem for path in (tmp_path / "out").glob("*.gltf")} == {"a", "b"}


def test_whatever_one_photo_does_the_others_are_done(
    folder, tiny_model, tmp_path, capsys, monkeypatch
):
    os.mkfifo(folder / "pipe.jpg")
    (folder / os.fsdecode(b"caf\xe9.png")).write_bytes((folder / "a.png").read_bytes())
    long = "n" * 250 + ".png"
    (folder / long).write_bytes((folder / "a.png").read_bytes())
    (folder / "c.heic").write_bytes(b"size" + b"ftypheic" + b"broken")
    (folder / "d.heic").write_bytes(b"size" + b"ftypheic" + b"huge")

    def opened(path):
        raise MemoryError if Path(path).name == "d.heic" else IndexError("list index out of range")

    monkeypatch.setattr("pillow_heif.HeifImageFile", opened)
    monkeypatch.setattr("lime_keras.io.photo.FULL", 3000)
    assert run(folder, weights_folder=tiny_model, out=tmp_path / "out") == 1
    told = capsys.readouterr().err
    for words in ("pipe.jpg cannot be", "not UTF-8: rename", "c.heic cannot be", "d.heic does not"):
        assert sum(words in line for line in told.splitlines() if "error: " in line) == 1, words
    assert f"warning: {folder / 'a.png'}: it has 90×40 pixels, more than" in told
    assert "3 done, 4 failed" in told, told
    names = {path.stem for path in (tmp_path / "out").glob("*.gltf")}
    assert names == {"a", "b", "n" * 200}


def test_want_of_memory_is_told_with_the_photo(folder, tiny_model, tmp_path, capsys, monkeypatch):
    def run_out(*_):
        raise MemoryError

    monkeypatch.setattr("lime_keras.runtime.onnx_graphs.OnnxGraphs.run", run_out)
    assert run(folder / "a.png", weights_folder=tiny_model, out=tmp_path / "out") == 1
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "error: " in line]
    assert f"{folder / 'a.png'} and what is estimated from it do not fit into memory: " in line


def test_a_full_disk_is_told_in_a_line(folder, tiny_model, tmp_path, capsys):
    with full_disk.files_end_after(300):
        assert run(folder / "a.png", weights_folder=tiny_model, out=tmp_path / "out") == 1
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "error: " in line]
    assert "cannot be written: " in line and str(tmp_path / "out") in line
    assert "partial-" not in line
    written = [path.name for path in (tmp_path / "out").glob("*") if path.stat().st_size > 300]
    assert not written and not list((tmp_path / "out").glob("partial-*"))


def test_a_folder_without_pictures_is_told(tmp_path, tiny_model, capsys):
    (tmp_path / "empty").mkdir()
    assert run(tmp_path / "empty", weights_folder=tiny_model, out=tmp_path / "out") == 1
    assert f"{tmp_path / 'empty'} has no pictures" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("there", "arguments"),
    [("best", []), ("live", ["--weights", "live"]), ("nano", ["--weights", "nano"])],
)
def test_a_set_is_used_by_its_name(there, arguments, folder, tiny_model, sets, tmp_path, capsys):
    sets(there)
    arguments = [*arguments, "--only", "albedo", "--out", str(tmp_path / "out")]
    assert estimate_cli.main([str(folder / "a.png"), *arguments]) == 0
    expected = Estimator(tiny_model, ["albedo"]).estimate(read_srgb(folder / "a.png"))
    told = capsys.readouterr()
    found = json.loads(told.out)["specular_albedo"]
    assert found == pytest.approx(expected.specular_albedo, rel=1e-4)
    assert "exported" not in told.err
    named = Estimator(there, ["albedo"]).estimate(read_srgb(folder / "a.png"))
    assert named.specular_albedo == pytest.approx(expected.specular_albedo)


def test_a_name_that_there_is_not_is_told_with_those_that_there_are(folder, sets, capsys):
    sets("live", "nano")
    assert estimate_cli.main([str(folder / "a.png"), "--weights", "micro"]) == 1
    assert capsys.readouterr().err.endswith("with the package: live, nano\n")
    with pytest.raises(FileNotFoundError, match="live, nano"):
        Estimator("micro")


def test_help_names_the_sets_and_the_default(sets, capsys):
    sets("live", "nano")
    with pytest.raises(SystemExit):
        estimate_cli.main(["--help"])
    assert "(live, nano; default: best)" in " ".join(capsys.readouterr().out.split())


def test_photos_of_one_name_are_numbered(folder, tiny_model, tmp_path):
    write(tmp_path / "a.png", photo((20, 20)))
    given = (folder / "a.png", f"{folder}/./a.png", tmp_path / "a.png")  # the second is the first
    assert run(*given, "--only", "mask", weights_folder=tiny_model, out=tmp_path / "out") == 0
    assert {path.name for path in (tmp_path / "out").glob("*.json")} == {"a.json", "a-2.json"}


def test_only_what_is_asked_for_is_run_and_written(folder, tiny_model, tmp_path, capsys):
    arguments = (folder / "a.png", "--only", "mask")
    assert run(*arguments, weights_folder=tiny_model, out=tmp_path / "out") == 0
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"a.json", "a-mask.png", "a-preview.png"} | GALLERY
    assert "(segmentation)" in capsys.readouterr().err


def test_a_given_mask_is_used_and_segmentation_is_not(folder, tiny_model, tmp_path, capsys):
    mask = np.zeros((40, 90, 1))
    mask[5:30, 20:60] = 1
    write(tmp_path / "mask.png", mask)
    arguments = (folder / "a.png", "--mask", tmp_path / "mask.png", "--only", "albedo")
    assert run(*arguments, weights_folder=tiny_model, out=tmp_path / "out") == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["mask_coverage"] == pytest.approx(25 * 40 / 3600, rel=1e-5)
    assert "(specular, albedo)" in told.err
    found = read_srgb(tmp_path / "out" / "a-mask.png")[..., :1]
    np.testing.assert_array_equal(found, mask)


def test_a_folder_of_masks_has_one_for_each_photo(folder, tiny_model, tmp_path, capsys):
    (tmp_path / "masks").mkdir()
    write(tmp_path / "masks" / "a.png", np.ones((40, 90, 1)))
    arguments = (folder, "--mask", tmp_path / "masks", "--only", "mask")
    assert run(*arguments, weights_folder=tiny_model, out=tmp_path / "out") == 1
    told = capsys.readouterr().err
    assert "holds nothing for" in told and "call it b" in told
    assert "1 done, 1 failed" in told
    arguments = (folder, "--mask", tmp_path / "masks" / "a.png")
    assert run(*arguments, weights_folder=tiny_model, out=tmp_path / "out2") == 1
    assert "is one file for 2 photos" in capsys.readouterr().err


def masked(shape, left, right):
    mask = np.zeros((*shape, 1))
    mask[:, left:right] = 1
    return mask


def test_a_mask_beside_a_photo_is_its_mask(folder, tiny_model, tmp_path, capsys):
    """Of photos in folders and of photos by name; it is no photo itself, and --mask comes first."""
    write(folder / "a_mask.png", masked((40, 90), 10, 40))
    for given in ([folder], [folder / "a.png", folder / "a_mask.png", folder / "b.png"]):
        out = tmp_path / f"out{len(given)}"
        assert run(*given, "--only", "mask", weights_folder=tiny_model, out=out) == 0
        told = capsys.readouterr()
        assert f"{folder / 'a_mask.png'} is taken as the mask of {folder / 'a.png'}" in told.err
        assert {path.name for path in out.glob("*.json")} == {"a.json", "b.json"}
        about = json.loads((out / "a.json").read_text())
        assert about["mask_coverage"] == pytest.approx(1 / 3, rel=1e-5)
        assert "mask_confidence" not in about
        assert "mask_confidence" in json.loads((out / "b.json").read_text())
    write(tmp_path / "mask.png", masked((40, 90), 0, 90))
    arguments = (folder / "a.png", "--mask", tmp_path / "mask.png", "--only", "mask")
    assert run(*arguments, weights_folder=tiny_model, out=tmp_path / "out") == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["mask_coverage"] == 1 and "is taken as" not in told.err
    assert run(folder / "a_mask.png", weights_folder=tiny_model, out=tmp_path / "none") == 1
    told = capsys.readouterr().err
    assert f"{folder / 'a_mask.png'} is the mask of {folder / 'a.png'}, not a photo" in told
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("mask", "told"),
    [
        (masked((40, 91), 0, 40), "91×40 pixels and its photo 90×40"),
        (masked((40, 90), 0, 0), "is nowhere white, so it masks no object"),
    ],
)
def test_a_mask_beside_a_photo_that_does_not_fit_is_told(mask, told, folder, tiny_model, capsys):
    write(folder / "a_mask.png", mask)
    out = folder / "out"
    assert run(folder / "a.png", weights_folder=tiny_model, out=out) == 1
    error = capsys.readouterr().err
    assert f"error: {folder / 'a.png'}: {folder / 'a_mask.png'} " in error and told in error
    assert not out.exists()


def test_a_masker_finds_the_object(folder, tiny_model, tmp_path, capsys):
    """It is taken where no mask is given; its family stands before a colon."""
    weights_file = tmp_path / "left.onnx"
    half = np.broadcast_to(np.arange(8) < 4, (1, 1, 8, 8)).astype(np.float32) * 0.9
    nodes = [onnx.helper.make_node("Identity", ["half"], ["mask"])]
    shapes = {"image": [1, 3, 8, 8]}, {"mask": [1, 1, 8, 8]}
    onnx.save(onnx_files.made(nodes, *shapes, {"half": half}), weights_file)
    write(folder / "b_mask.png", masked((33, 20), 0, 20))
    for text in (weights_file, f"isnet:{weights_file}"):
        arguments = (folder, "--masker", text, "--only", "albedo", "--overwrite")
        assert run(*arguments, weights_folder=tiny_model, out=tmp_path / "out") == 0
        assert "(specular, albedo)" in capsys.readouterr().err
        first, second = (json.loads((tmp_path / "out" / f"{n}.json").read_text()) for n in "ab")
        assert first["mask_coverage"] == pytest.approx(0.5, abs=0.05)
        assert 0.8 < first["mask_confidence"] < 0.95
        assert second["mask_coverage"] == 1 and "mask_confidence" not in second
    for options, told in (
        (["--masker", "none.onnx"], "none.onnx is no file: pass an ONNX file to --masker"),
        (["--masker", weights_file, "--mask", folder / "a.png"], "both say where the object is"),
    ):
        arguments = (folder / "a.png", *options)
        assert run(*arguments, weights_folder=tiny_model, out=tmp_path / "no") == 1
        assert told in capsys.readouterr().err and not (tmp_path / "no").exists()


@pytest.fixture
def blind(monkeypatch):
    """SegmentationNet finds nothing."""
    nothing = np.zeros((32, 32, 1), np.float32)
    monkeypatch.setattr(
        Estimator, "_segment", lambda self, *of: replace(self._cut(*of), mask=nothing)
    )


def test_without_an_object_there_is_no_material(blind, folder, tiny_model, tmp_path, capsys):
    write(folder / "b_mask.png", masked((33, 20), 0, 10))
    out = tmp_path / "out"
    assert run(folder, weights_folder=tiny_model, out=out) == 1
    told = capsys.readouterr()
    assert f"warning: {folder / 'a.png'}: no object was found" in told.err
    assert "2 done, 0 failed, 1 without an object" in told.err
    assert {path.name for path in out.glob("a*")} == {"a.json", "a-mask.png", "a-preview.png"}
    assert (out / "b.gltf").is_file()
    about = json.loads((out / "a.json").read_text())
    assert set(about) == {"photo", "mask_coverage", "square", "warnings", "files", "made"}
    assert [caution["code"] for caution in about["warnings"]] == ["no-object"]
    # Nor is there a light, and this is not told as another failure.
    arguments = (folder / "a.png", "--normals", folder / "b.png", "--overwrite")
    assert run(*arguments, weights_folder=tiny_model, out=out) == 1
    assert "1 done, 0 failed, 1 without an object" in capsys.readouterr().err
    assert not (out / "a-environment.exr").exists()
    # One of each kind.
    arguments = (folder / "a.png", folder / "gone.png", "--overwrite")
    assert run(*arguments, weights_folder=tiny_model, out=out) == 1
    assert "1 done, 1 failed, 1 without an object" in capsys.readouterr().err


def test_warnings_are_told_by_the_photo(folder, tiny_model, tmp_path, capsys):
    write(folder / "a_mask.png", masked((40, 90), 0, 40))
    arguments = (folder / "a.png", "--only", "mask")
    assert run(*arguments, weights_folder=tiny_model, out=tmp_path / "out") == 0
    told = capsys.readouterr()
    about = json.loads(told.out)["warnings"]
    told_codes = [caution["code"] for caution in about]
    assert told_codes == ["few-pixels", "touches-frame", "second-colour"]  # its pixels are noise
    for caution in about:
        assert f"warning: {folder / 'a.png'}: {caution['message']}" in told.err


def test_a_cut_outs_transparency_is_its_mask(tiny_model, tmp_path, capsys):
    from PIL import Image

    levels = np.full((32, 32, 4), 150, np.uint8)
    levels[:, :16, 3], levels[:, 16:, 3] = 0, 255
    Image.fromarray(levels).save(tmp_path / "cut.png")
    arguments = (tmp_path / "cut.png", "--only", "albedo")
    assert run(*arguments, weights_folder=tiny_model, out=tmp_path / "out") == 0
    told = capsys.readouterr()
    assert json.loads(told.out)["mask_coverage"] == 0.5 and "(specular, albedo)" in told.err


def test_beside_a_mask_file_a_photos_transparency_is_not_passed_on(tiny_model, tmp_path):
    """A clone keeps a photo transparent where it is, unless a mask takes the place of that."""
    pixels = np.concatenate([photo((40, 90)), masked((40, 90), 10, 80)], axis=-1)
    write(tmp_path / "a.png", pixels)
    alphas = []

    def clone(image, mask, material, light, *, alpha):
        alphas.append(alpha)
        return image

    for name in ("alone", "masked"):
        arguments = [str(tmp_path / "a.png"), "--weights", str(tiny_model)]
        options = estimate_cli.parser().parse_args([*arguments, "--out", str(tmp_path / name)])
        assert estimate_cli.run(options, make_clone=lambda: clone) == 0
        assert (tmp_path / name / "a-clone.png").is_file()
        write(tmp_path / "a_mask.png", masked((40, 90), 10, 80))
    np.testing.assert_array_equal(alphas[0], masked((40, 90), 10, 80))
    assert alphas[1] is None


def test_the_command_writes_what_an_ablation_answers(ablation, ablation_model, tmp_path, capsys):
    write(tmp_path / "ball.png", photo((40, 90)))
    arguments = [str(tmp_path / "ball.png"), "--weights", str(ablation_model)]
    out = tmp_path / "out"
    assert estimate_cli.main([*arguments, "--out", str(out)]) == 0
    material = Estimator(ablation_model).estimate(read_srgb(tmp_path / "ball.png"))
    written = json.loads((out / "ball.json").read_text(encoding="utf-8"))
    assert json.loads(capsys.readouterr().out) == written
    del written["made"], written["files"]
    assert written == {"photo": str(tmp_path / "ball.png")} | material.to_json()
    pictures = {f"ball-{name}.png" for name in [*material.layers, "preview"]}
    linear = [n for n in material.layers if n not in ("mask", "diffuse", "recomposed")]
    engines = {"ball.mtl", "ball.gltf", "ball-mitsuba.json"}
    assert {path.name for path in out.iterdir()} == pictures | engines | {"ball.json"} | {
        f"ball-{name}.exr" for name in linear
    } | GALLERY
    for name in linear:
        image = oiio.ImageBuf(str(out / f"ball-{name}.exr")).get_pixels(oiio.FLOAT)
        np.testing.assert_allclose(image, material.layers[name], rtol=1e-3, atol=1e-3)


# What is loaded.

ALONE = """
import sys

class Away:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {away}:
            raise ModuleNotFoundError("No module named " + repr(name))

sys.meta_path.insert(0, Away())
from lime_keras.render.commands.clone import main
status = main(sys.argv[1:])
loaded = {light} & set(sys.modules)
assert not loaded, loaded
sys.exit(status)
"""
EXTRA = {module for modules in console.EXTRAS.values() for module in modules} | {"drjit", "h5py"}


def alone(*arguments, light=()):
    """Run the command in a process without what the extras bring; `light` must not be loaded."""
    code = ALONE.format(away=EXTRA, light=set(light) or "set()")
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True)


def test_photos_and_videos_take_nothing_of_the_extras(folder, tmp_path):
    write(folder / "a_mask.png", np.ones((40, 90, 1)))
    clip = clips.write(tmp_path / "clip.mkv", np.stack([ball(64)] * 2))
    answer = alone(folder / "a.png", clip, "--out", tmp_path / "out")
    assert answer.returncode == 0, answer.stderr
    assert json.loads((tmp_path / "out" / "a.json").read_text())["specular_albedo"] >= 0
    assert (tmp_path / "out" / "a-preview.png").is_file()
    assert (tmp_path / "out" / "clip-overlay.mp4").is_file()


def ball(size):
    """A lit ball before grey, uint8, which the model that comes with the package finds."""
    rows, columns = (np.mgrid[:size, :size] + 0.5) / size * 2 - 1
    depth = 1 - (rows**2 + columns**2) / 0.5
    shade = 0.2 + 0.6 * np.sqrt(np.maximum(depth, 0)) * np.clip(0.8 - columns, 0, 1)
    image = np.where(depth[..., None] > 0, shade[..., None] * [1.0, 0.6, 0.3], 0.45)
    return (image * 255).astype(np.uint8)


def test_a_photo_takes_no_video_library(folder, tmp_path):
    write(folder / "a_mask.png", np.ones((40, 90, 1)))
    answer = alone(folder / "a.png", "--out", tmp_path / "out", light=["av", "pillow_heif"])
    assert answer.returncode == 0, answer.stderr


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["none.png", "gone.mp4"], "none.png does not exist"),
        (["HERE", "--mask", "none.png"], "none.png does not exist: check what is passed to --mask"),
        (["HERE", "--weights", "none"], "none holds no trained model"),
        (
            ["HERE", "--clone-onto", "HERE"],
            "needs mitsuba, trimesh, scipy, manifold3d: pip install",
        ),
        (["HERE", "--up", "z"], "pass one to --clone-onto"),
        (["HERE", "--shadow"], "pass one to --clone-onto"),
        (["HERE", "CLIP", "--mask", "HERE"], "clip.mp4 is a video: leave one out"),
        (["HERE", "--normals", "HERE", "--only", "albedo"], "leave out --only"),
    ],
    ids=["photo", "mask", "weights", "clone", "up", "shadow", "mask of a video", "part of a light"],
)
def test_what_cannot_be_done_is_told_before_anything_is_loaded(arguments, told, folder, tmp_path):
    there = {"HERE": folder / "a.png", "CLIP": folder / "clip.mp4"}
    there["CLIP"].write_bytes(b"a clip")
    given = [str(there.get(name, name)) for name in arguments]
    light = ["numpy", "onnxruntime", "OpenImageIO", "PIL"]
    answer = alone(*given, "--out", tmp_path / "out", light=light)
    assert answer.returncode == 1
    assert told in answer.stderr and "Traceback" not in answer.stderr
    assert not (tmp_path / "out").exists()


def test_the_keras_engine_that_is_missing_is_told(folder, tmp_path):
    answer = alone(folder / "a.png", "--engine", "keras", "--out", tmp_path / "out")
    assert answer.returncode == 1
    assert "the Keras engine needs keras: pip install '.[train]'" in answer.stderr


def test_the_engines_give_the_same_files(folder, tiny_model, tmp_path, capsys):
    for engine in ("onnx", "keras"):
        arguments = (folder / "a.png", "--engine", engine)
        assert run(*arguments, weights_folder=tiny_model, out=tmp_path / engine) == 0
    names = {path.name for path in (tmp_path / "onnx").iterdir()}
    assert names == {path.name for path in (tmp_path / "keras").iterdir()}
    one, other = (json.loads((tmp_path / e / "a.json").read_text()) for e in ("onnx", "keras"))
    assert one.keys() == other.keys()
    assert [c["code"] for c in one["warnings"]] == [c["code"] for c in other["warnings"]]
    words = {"gloss", "diffuse_srgb_hex"}
    assert [one[name] for name in words] == [other[name] for name in words]
    for name in set(one) - {"photo", "warnings", "made", "files", *words}:
        np.testing.assert_allclose(one[name], other[name], rtol=1e-4, atol=1e-5)
    for name in filter(lambda name: name.endswith(".png"), names):
        first, second = (read_srgb(tmp_path / e / name) for e in ("onnx", "keras"))
        np.testing.assert_allclose(first, second, atol=1.01 / 255)
