"""`lime-render`: what it prints, and how it ends."""

import json
import shutil
import subprocess
import sys

import numpy as np
import OpenImageIO as oiio
import pytest
import trimesh
from in_process import InProcess

from lime_keras.data.corpus import SPLITS
from lime_keras.render import cli
from lime_keras.render.commands import corpus
from lime_keras.render.corpus import split as rendering
from lime_keras.render.inspect import verification
from lime_keras.render.jobs.processes import THREAD_VARIABLES
from lime_keras.render.mitsuba_setup import variants


@pytest.fixture
def render(monkeypatch, capsys, mitsuba_choice, tmp_path):
    """Runs the command; gives exit status, standard output and standard error."""
    monkeypatch.setattr(variants, "choose", lambda device=None: mitsuba_choice)
    monkeypatch.setattr(rendering, "Pool", InProcess)
    for name in THREAD_VARIABLES:
        monkeypatch.setenv(name, "1")

    def run(*options):
        status = cli.main([str(tmp_path / "corpus"), "--split", "train", *map(str, options)])
        return status, *capsys.readouterr()

    return run


def test_the_options_reach_the_renderer(render, monkeypatch, tmp_path):
    calls = []

    def render_split(out, description, choice, *, on_input, on_room, on_example, **options):
        on_input(2, 2)
        on_room(1, 2)
        on_example(0, 9)
        on_example(9, 9)
        calls.append((out, description, options))
        failure = {"index": 4, "attempt": 0, "error": "the object covers 0.1% of the image"}
        return {
            "examples": 9,
            "failures": [failure],
            "skipped": {"shapes": {"a.ply": "cannot be read"}},
            "repaired": ["environments: b.exr: 3 texels"],
        }

    monkeypatch.setattr(rendering, "render_split", render_split)
    monkeypatch.chdir(tmp_path)
    status, printed, progress = render(
        *("--count", 9, "--seed", 3, "--size", 64, "--shard-size", 4),
        *("--shapes", "meshes", "--workers", 8, "--quality", "reference", "--unusable", "skip"),
    )
    assert status == 0 and printed == f"9 examples in {tmp_path / 'corpus' / 'train'}\n"
    assert "replaced: example 4: the object covers" in progress
    assert "skipped: shapes: a.ply: cannot be read" in progress
    assert "repaired: environments: b.exr: 3 texels" in progress
    [(out, description, options)] = calls
    assert out == tmp_path / "corpus"
    assert options == {"workers": 8, "part": (1, 1), "skip_unusable": True}
    expected = ("train", 9, 3, 64, 4, "reference", "furnace", str(tmp_path / "meshes"), None, None)
    assert tuple(vars(description).values())[: len(expected)] == expected
    assert description.materials == "uniform"
    assert (description.light_law, description.endless) == ("mixed", 0.25)
    for options, laws in (
        (("--split", "test"), ("maps", 0.0)),
        (("--light-law", "maps", "--endless", 0.75), ("maps", 0.75)),
    ):
        assert render("--count", 9, *options)[0] == 0
        assert (calls[-1][1].light_law, calls[-1][1].endless) == laws


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--lights", "known"), "--lights known is of a test split: pass --split test"),
        (("--split", "test", "--light-law", "mixed"), "--split test has single maps and shapes as"),
        (("--split", "test", "--endless", 0.1), "leave out --light-law and --endless"),
        (
            ("--shape-count", 5, "--shapes", "m"),
            "--shape-count changes nothing beside --shapes: pass",
        ),
        (("--endless", 1, "--shapes", "m"), "--endless 1 shows no file beside --shapes"),
        (("--light-count", 5, "--environments", "m", "--split", "test"), "beside --environments"),
        (("--materials", "natural", "--lobe", "printed"), "leave out --lobe printed"),
    ],
)
def test_options_that_contradict_each_other_are_told(render, tmp_path, options, message):
    status, _, errors = render("--count", 1, *options)
    assert status == 1 and message in errors
    assert not (tmp_path / "corpus").exists()


@pytest.mark.parametrize("part", ["3/2", "0/2", "x", "1/2/3"])
def test_a_part_that_there_is_not_is_told(render, capsys, part):
    with pytest.raises(SystemExit):
        render("--count", 1, "--part", part)
    assert f"argument --part: {part} is no part K/N, with K of 1 … N" in capsys.readouterr().err


def test_the_last_part_to_end_writes_manifest_and_cards(render, inputs, tmp_path):
    told = ["1 of 2 shards are there; the last part to end writes the manifest"]
    told += [f"4 examples in {tmp_path / 'corpus' / 'train'}"]
    options = (*inputs, "--unusable", "skip", "--shard-size", 2)
    for part, line in enumerate(told, 1):
        status, printed, _ = render(*options, "--part", f"{part}/2")
        assert status == 0 and printed == line + "\n"
        assert (tmp_path / "corpus" / "README.md").exists() == (part == 2)


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


@pytest.fixture
def inputs(tmp_path):
    """Two sound meshes and maps of which the test split gets one each, and broken ones beside."""
    for kind in ("shapes", "environments"):
        for split in SPLITS:
            (tmp_path / kind / split).mkdir(parents=True)
    for split in SPLITS:
        trimesh.creation.icosphere(subdivisions=3, radius=1 + (split == "test")).export(
            tmp_path / "shapes" / split / f"ball-{split}.ply"
        )
        (tmp_path / "shapes" / split / "broken.ply").write_bytes(b"ply\nnothing")
        image = oiio.ImageBuf(np.full((64, 128), 1 + (split == "test"), np.float16))
        assert image.write(str(tmp_path / "environments" / split / f"even-{split}.exr"))
        (tmp_path / "environments" / split / "cut.hdr").write_bytes(b"#?RADIANCE\n")
    return [
        *("--shapes", tmp_path / "shapes", "--environments", tmp_path / "environments"),
        *("--count", 4, "--size", 64, "--workers", 1, "--light-law", "maps", "--endless", 0),
    ]


def test_files_that_cannot_be_used_are_refused_by_name_before_anything_is_rendered(
    render, inputs, tmp_path
):
    status, printed, errors = render(*inputs)
    assert status == 1 and not printed
    assert "error: 2 files cannot be used:" in errors
    assert "shapes: broken.ply: " in errors and "environments: cut.hdr: " in errors
    assert errors.endswith("pass --unusable skip\n")
    assert not (tmp_path / "corpus").exists()


def test_a_corpus_with_skipped_files_is_sound_and_can_be_looked_at(
    render, inputs, tmp_path, capsys
):
    status, printed, errors = render(*inputs, "--unusable", "skip")
    assert status == 0, errors
    assert "skipped: shapes: broken.ply: " in errors
    manifest = json.loads((tmp_path / "corpus" / "train" / "manifest.json").read_text())
    assert (
        manifest["shapes"] == ["ball-train.ply"] and "broken.ply" in manifest["skipped"]["shapes"]
    )
    assert render(*inputs, "--unusable", "skip")[:2] == (status, printed)  # a rerun finds it done
    corpus = str(tmp_path / "corpus")
    assert cli.main(["verify", corpus]) == 0
    assert capsys.readouterr().out == f"4 examples in {corpus}/train: sound\n"
    layers = ["layers", corpus, "3", "--split", "train"]
    elsewhere = tmp_path / "example.exr"
    # A split that is not complete has no sheet yet.
    begun = tmp_path / "corpus" / "test" / "description.json"
    begun.parent.mkdir()
    begun.touch()
    for command, count in (
        (["preview", corpus], 1),
        (layers, 2),
        ([*layers, "--out", str(elsewhere)], 2),
    ):
        assert cli.main(command) == 0
        written = capsys.readouterr().out.splitlines()
        assert len(written) == count
        for path in written:
            assert not oiio.ImageBuf(path).has_error
    assert elsewhere.is_file()
    shutil.rmtree(begun.parent)
    assert cli.main(["verify", corpus]) == 0  # what was drawn beside the shards is no stray
    capsys.readouterr()
    shard = tmp_path / "corpus" / "train" / "00001.tfrecord"
    shard.write_bytes(shard.read_bytes()[:-9])
    assert cli.main(["verify", corpus]) == 1
    printed, errors = capsys.readouterr()
    assert "00001.tfrecord" in errors and "faults" in printed


def test_ten_faults_of_a_kind_are_told_in_words(monkeypatch, capsys, tmp_path):
    faults = [("seed", "record 3: is wrong")]
    faults += [("index", f"record {index}: is wrong") for index in range(25)]
    monkeypatch.setattr(verification, "verify", lambda *_: faults)
    assert cli.main(["verify", str(tmp_path), "--split", "test"]) == 1
    printed, errors = capsys.readouterr()
    assert printed == f"0 examples in {tmp_path / 'test'}: 26 faults\n"
    lines = errors.splitlines()
    assert lines[:2] == ["seed: record 3: is wrong", "index: record 0: is wrong"]
    assert lines[10:] == ["index: record 9: is wrong", "index: … and 15 more"]


def test_the_same_mesh_under_another_name_is_kept_out_of_the_other_split(render, inputs, tmp_path):
    assert render(*inputs, "--unusable", "skip")[0] == 0
    (tmp_path / "shapes" / "test" / "copy.ply").write_bytes(
        (tmp_path / "shapes" / "train" / "ball-train.ply").read_bytes()
    )
    status, _, errors = render(*inputs, "--unusable", "skip", "--split", "test")
    assert status == 1 and "copy.ply has the contents of ball-train.ply" in errors


def test_verify_tells_the_extra_that_it_lacks(without, tmp_path, capsys):
    without("trimesh")
    assert cli.main(["verify", str(tmp_path)]) == 1
    assert "lime-render verify needs trimesh: pip install '.[render]'" in capsys.readouterr().err


def test_looking_at_nothing_is_an_error(tmp_path, capsys):
    for command in ("verify", "preview"):
        assert cli.main([command, str(tmp_path)]) == 1
        assert "holds no corpus: render one with" in capsys.readouterr().err
    assert cli.main(["layers", str(tmp_path), "--split", "test", "0"]) == 1
    assert "lime-render" in capsys.readouterr().err


CORPUS = ["corpus", "--split", "train"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*CORPUS, "--count", "0"], "0 is not at least 1"),
        ([*CORPUS, "--count", "1", "--seed", "-1"], "-1 is not in 0"),
        ([*CORPUS, "--count", "1", "--size", "100"], "100 is not a multiple of 32"),
        ([*CORPUS, "--count", "1", "--endless", "1.5"], "1.5 is not in 0 … 1"),
        ([*CORPUS, "--count", "1", "--size", "large"], "invalid"),
        ([*CORPUS, "--count", "1", "--split", "valid"], "invalid choice"),
        (CORPUS, "required: --count"),
        ([*CORPUS, "--count", "1", "--verify"], "unrecognized arguments: --verify"),
        (["corpus", "--count", "3"], "required: --split"),
        (["verify", "corpus", "--count", "3"], "unrecognized arguments: --count 3"),
        (["verify", "corpus", "--split", "valid"], "invalid choice"),
        (["preview"], "required: CORPUS"),
        (["layers", "corpus", "0"], "required: --split"),
        (["layers", "corpus", "--split", "test"], "required: INDEX"),
        (["layers", "corpus", "first", "--split", "test"], "invalid"),
        (["images", "corpus"], "required: OUT"),
        (["views", "hdris"], "required: OUT"),
        (["views", "hdris", "views", "--count", "0"], "0 is not at least 1"),
    ],
)
def test_wrong_usage_of_each_command_ends_with_2(capsys, arguments, message):
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    assert stop.value.code == 2 and message in capsys.readouterr().err


def test_a_corpus_that_is_called_like_a_command_is_rendered_by_its_path(monkeypatch):
    rendered = []
    monkeypatch.setattr(corpus, "run", lambda options: rendered.append(options.out) or 0)
    assert cli.main(["./verify", "--split", "test", "--count", "1"]) == 0
    assert cli.main(["--split", "test", "--count", "1", "verify"]) == 0
    assert [str(out) for out in rendered] == ["verify", "verify"]


def test_the_help_names_every_command():
    for name in cli.COMMANDS:
        assert f"lime-render {name} " in cli.parser().format_help()


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
