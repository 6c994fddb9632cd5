"""A recipe carried out: each step once, gone on with after a stop, and refused where it differs."""

import errno
import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from lime_keras import machine
from lime_keras.io import photo
from lime_keras.train import cli, provenance
from lime_keras.train.recipes import cutouts, data, recipe, run

RECIPE = """
from lime_keras.train.recipes import Corpus, Recipe, Training

TINY = ("--width", "2", "--encoder-width", "2", "--no-camera")
RECIPE = Recipe(
    preset="smoke",
    size=32,
    corpora={"own": Corpus(40, seed=1, size=32, endless=0.0)},
    trainings={
        "masks": Training(
            ("segmentation",), ("own",), steps=2, rate=1e-3, photos=16, batch_size=4,
            materials=(), optimizer="adam", average=0.5, options=TINY,
        ),
        "rest": Training(
            ("specular", "mirror", "albedo", "exponent"), ("own",), steps=2, rate=1e-3, photos=16,
            batch_size=4, materials=(), start_from="masks", options=TINY,
        ),
    },
    validation=Corpus(8, seed=9, size=32),
    held_out=(2, 1),
)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder of data: meshes of a ball, and maps of even light."""
    out = tmp_path_factory.mktemp("data")
    for kind in data.SUFFIXES:
        (out / kind).mkdir()
    for number in range(10):
        ball = trimesh.creation.icosphere(subdivisions=1 + number % 2)
        ball.apply_scale([1, 1, 1 - number / 20])
        ball.export(out / "meshes" / f"ball{number}.ply")
    for number in range(5):
        radiance = np.random.default_rng(number).uniform(0.5, 1, (16, 32, 3)).astype(np.float32)
        photo.write(out / "environments" / f"map{number}.exr", radiance)
    return out


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(RECIPE)
    return str(path)


@pytest.fixture
def commands(monkeypatch):
    """In place of the commands: what each would make, in files that hold their own words.

    The list holds the folder of each command that was run; a name put into `fail` stops before it.
    """
    ran = []

    def pretend(command, folder):
        made = command[command.index("--out") + 1] if "--out" in command else command[1]
        if made == "views":
            made = command[3]
        if made in pretend.stop:
            raise KeyboardInterrupt
        ran.append(made)
        files = {
            "lime-render": [f"{command[3]}/manifest.json"],
            "lime-train": ["config.json", "model/architecture.json", "onnx/a.onnx", "photos/a"],
            "lime-eval": ["metrics.json"],
        }[command[0]]
        for file in files:
            (folder / made / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / made / file).write_text(json.dumps({"of": command}))

    pretend.ran, pretend.stop = ran, set()
    monkeypatch.setattr(run, "_run", pretend)
    return pretend


ALL = ["corpora/own", "trainings/masks", "trainings/rest", "corpora/validation", "eval"]


def test_a_run_takes_each_step_once(own, folder, commands, tmp_path, capsys, monkeypatch):
    out = tmp_path / "run"
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    run.carry_out(own, out, data_folder=folder)
    assert commands.ran == ALL
    run.carry_out(own, out, data_folder=folder)
    assert commands.ran == ALL
    # The set, with the record of what it follows from.
    record = json.loads((out / "model" / "training.json").read_text())
    assert record["of"][0] == "lime-train" and record["recipe"]["name"] == "own"
    assert list(record["steps"]) == ALL and all(one["done"] for one in record["steps"].values())
    assert {"sha256", "seed", "data"} < set(record["recipe"])
    made = record["steps"]["trainings/rest"]
    assert made["commit"] == [provenance.commit()] and made["machine"] == machine.describe()
    assert made["threads"]["OMP_NUM_THREADS"] == "3"
    # And how it did on its validation scenes.
    assert record["validation"] == json.loads((out / "eval" / "metrics.json").read_text())
    assert (out / "onnx" / "a.onnx").is_file()
    assert not list(out.rglob("photos"))
    files = json.loads((out / "data.json").read_text())
    assert len(files) == 15 and data.total(files) == record["recipe"]["data"]
    told = capsys.readouterr().err
    assert "15 of 15 meshes and maps are not of the list" in told
    assert "[2/5] trainings/masks: lime-train corpora/own --out trainings/masks" in told
    assert f"make ship WEIGHTS={out}" in told


@pytest.mark.parametrize("at", ALL)
def test_a_stopped_run_goes_on(own, folder, commands, tmp_path, monkeypatch, at):
    out, ticks = tmp_path / "run", itertools.count(0, 10)
    monkeypatch.setattr(run.time, "monotonic", lambda: next(ticks))
    monkeypatch.setattr(run, "commit", lambda: "first")
    commands.stop.add(at)
    with pytest.raises(KeyboardInterrupt):
        run.carry_out(own, out, data_folder=folder)
    assert commands.ran == ALL[: ALL.index(at)]
    commands.stop.clear()
    monkeypatch.setattr(run, "commit", lambda: "second")
    run.carry_out(own, out, data_folder=folder)
    assert commands.ran == ALL
    # The record of the step that was stopped names both commits, and the time of both sittings.
    record = json.loads((out / "model" / "training.json").read_text())["steps"]
    assert record[at]["commit"] == ["first", "second"] and record[at]["seconds"] == 20
    assert all(one["seconds"] == 10 for name, one in record.items() if name != at)


def test_a_folder_of_something_else_is_refused(own, folder, commands, tmp_path):
    plain = tmp_path / "plain"
    plain.mkdir()
    (plain / "config.json").write_text("{}")
    with pytest.raises(ValueError, match="plain holds a model of no recipe: pass another --out"):
        run.carry_out(own, plain, data_folder=folder)
    # A model that would be taken for the set that a training begins with.
    Path(own).write_text(RECIPE.replace("materials=(), opt", 'start_from="live", opt'))
    (tmp_path / "run" / "live").mkdir(parents=True)
    with pytest.raises(ValueError, match="run/live would be taken for that set: pass another"):
        run.carry_out(own, tmp_path / "run", data_folder=folder)
    assert commands.ran == []
    # The data themselves, which keep all of their files.
    out = tmp_path / "out"
    shutil.copytree(folder, out / "data")
    before = sorted(out.rglob("*"))
    with pytest.raises(ValueError, match="data is for links to the data: pass another --out"):
        run.carry_out(own, out, data_folder=out / "data")
    assert sorted(out.rglob("*")) == before


def test_a_recipe_that_made_nothing_yet_may_be_mended(own, folder, commands, tmp_path):
    out = tmp_path / "run"
    commands.stop.add("corpora/own")
    with pytest.raises(KeyboardInterrupt):
        run.carry_out(own, out, data_folder=folder)
    commands.stop.clear()
    (out / "cutouts.json").write_text("{}")
    Path(own).write_text(RECIPE.replace("seed=1,", "seed=2,"))
    run.carry_out(own, out, data_folder=folder)
    assert commands.ran == ALL
    assert "--seed 2" in json.loads((out / "steps" / "corpora" / "own.json").read_text())["command"]


def test_options_that_a_training_would_refuse_are_told_before_the_first_step(
    own, folder, commands, tmp_path, capsys
):
    Path(own).write_text(RECIPE.replace('"--width"', '"--widht"', 1))
    with pytest.raises(ValueError, match="trainings/masks: lime-train refuses it"):
        run.carry_out(own, tmp_path / "run", data_folder=folder)
    assert "unrecognized arguments: --widht" in capsys.readouterr().err
    assert not commands.ran


def test_another_set_is_evaluated_anew(own, folder, commands, tmp_path):
    out = tmp_path / "run"
    run.carry_out(own, out, data_folder=folder)
    commands.ran.clear()
    architecture = out / "trainings" / "rest" / "model" / "architecture.json"
    architecture.write_text(architecture.read_text() + "\n")
    run.carry_out(own, out, data_folder=folder)
    assert commands.ran == ["eval"]


def test_graphs_that_could_not_be_written_are_tried_again(
    own, folder, commands, tmp_path, monkeypatch, capsys
):
    def write(trained):
        if "full" not in tried:
            tried.append("full")
            return "no graphs for lime-estimate (disk full)"
        (trained / "onnx").mkdir()
        return "its graphs"

    out, tried = tmp_path / "run", []
    run.carry_out(own, out, data_folder=folder)
    shutil.rmtree(out / "trainings" / "rest" / "onnx")
    monkeypatch.setattr(run.graphs, "write", write)
    with pytest.raises(RuntimeError, match="rest has no graphs, for the reason above"):
        run.carry_out(own, out, data_folder=folder)
    assert "disk full" in capsys.readouterr().err
    run.carry_out(own, out, data_folder=folder)


def test_only_what_is_missing_is_made_again(own, folder, commands, tmp_path):
    out = tmp_path / "run"
    run.carry_out(own, out, data_folder=folder)
    commands.ran.clear()
    # On a new machine without corpora, trained weights need none.
    shutil.rmtree(out / "corpora")
    shutil.rmtree(out / "data")
    run.carry_out(own, out, data_folder=folder)
    assert commands.ran == []
    shutil.rmtree(out / "trainings" / "rest")
    record = json.loads((out / "steps" / "corpora" / "own.json").read_text())
    (out / "steps" / "corpora" / "own.json").write_text(json.dumps(record | {"seconds": 9999}))
    run.carry_out(own, out, data_folder=folder)
    assert commands.ran == ["corpora/own", "trainings/rest"]
    # Its seconds are those of what is there now.
    assert json.loads((out / "steps" / "corpora" / "own.json").read_text())["seconds"] < 60


def test_another_recipe_or_other_data_are_refused(own, folder, commands, tmp_path):
    out = tmp_path / "run"
    run.carry_out(own, out, data_folder=folder)
    with pytest.raises(ValueError, match=r"holds another run: seed 0 there, 1 asked.*--reuse"):
        run.carry_out(own, out, data_folder=folder, seed=1)
    Path(own).write_text(RECIPE.replace("rate=1e-3, photos=16, b", "rate=2e-3, photos=16, b", 1))
    said = r"recipe.trainings.masks.rate 0.001 there, 0.002 asked"
    with pytest.raises(ValueError, match=said):
        run.carry_out(own, out, data_folder=folder)
    Path(own).write_text(RECIPE)
    other = tmp_path / "other"
    shutil.copytree(folder, other)
    (other / "meshes" / "ball0.ply").write_bytes(b"")
    with pytest.raises(ValueError, match=r"data.meshes/ball0.ply \w{64} there, \w{64} asked"):
        run.carry_out(own, out, data_folder=other)
    with pytest.raises(ValueError, match="reads meshes and environments: pass --data"):
        run.carry_out(own, tmp_path / "new")
    # One content on both sides of validation.
    names = sorted(path.name for path in (folder / "meshes").iterdir())
    kept = min(data.validation_names(names, 2))
    twin = min(set(names) - data.validation_names(names, 2))
    shutil.copyfile(folder / "meshes" / kept, other / "meshes" / twin)
    with pytest.raises(ValueError, match=f"{kept} and meshes/{twin} may be the same"):
        run.carry_out(own, tmp_path / "new", data_folder=other)
    with pytest.raises(ValueError, match="builtin reads no meshes and maps: leave out --data"):
        run.carry_out("builtin", tmp_path / "new", data_folder=folder)
    (out / "recipe.json").write_text("[]")
    with pytest.raises(ValueError, match=r"recipe.json cannot be read as the record of a recipe"):
        run.carry_out(own, out, data_folder=folder)


def test_equal_steps_are_taken_over(own, folder, commands, tmp_path, capsys):
    first, second = tmp_path / "first", tmp_path / "second"
    run.carry_out(own, first, data_folder=folder)
    commands.ran.clear()
    # Another last training: what it needs is the same.
    text = RECIPE.replace('start_from="masks"', 'start_from="masks", optimizer="adam"')
    Path(own).write_text(text)
    run.carry_out(own, second, data_folder=folder, reuse=first)
    assert commands.ran == ["trainings/rest", "eval"]
    assert f"trainings/masks: taken over from {first}" in capsys.readouterr().err
    # Another side of validation: other corpora, and so nothing is the same.
    commands.ran.clear()
    Path(own).write_text(text.replace("held_out=(2, 1)", "held_out=(1, 1)"))
    run.carry_out(own, tmp_path / "third", data_folder=folder, reuse=first)
    assert commands.ran == ALL
    with pytest.raises(FileNotFoundError, match="holds no run of a recipe: check --reuse"):
        run.carry_out(own, tmp_path / "fourth", data_folder=folder, reuse=tmp_path)


def test_a_run_of_an_older_version_is_taken_over(own, folder, commands, tmp_path):
    first = tmp_path / "first"
    run.carry_out(own, first, data_folder=folder)
    # It recorded one commit, and a step only when it was done.
    reopened = run._Run(own, recipe.find(own), first, folder, None, None)
    for path in (first / "steps").rglob("*.json"):
        name = path.relative_to(first / "steps").with_suffix("").as_posix()
        record = json.loads(path.read_text())
        old = {"key": reopened._key(name), "seconds": 5, "commit": "abc"}
        path.write_text(json.dumps({"command": record["command"]} | old))
    commands.ran.clear()
    run.carry_out(own, tmp_path / "second", data_folder=folder, reuse=first)
    assert commands.ran == ["eval"]
    made = json.loads((tmp_path / "second" / "model" / "training.json").read_text())
    assert made["steps"]["trainings/masks"]["commit"] == ["abc"]


def test_a_step_follows_from_the_set_that_it_begins_with(own, folder, commands, tmp_path):
    first, made = tmp_path / "first", ["trainings/masks", "trainings/rest", "eval"]
    Path(own).write_text(RECIPE.replace("materials=(), opt", 'start_from="live", opt'))
    run.carry_out(own, first, data_folder=folder)
    commands.ran.clear()
    run.carry_out(own, tmp_path / "same", data_folder=folder, reuse=first)
    assert commands.ran == ["eval"]
    commands.ran.clear()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run.model_folder, "digest", lambda path: "another")
        run.carry_out(own, tmp_path / "other", data_folder=folder, reuse=first)
        assert commands.ran == made
        # In its own folder the step is made anew, from nothing.
        stale = first / "trainings" / "masks" / "stale"
        stale.touch()
        commands.ran.clear()
        run.carry_out(own, first, data_folder=folder)
    assert commands.ran == made and not stale.exists()


def test_a_command_that_fails_ends_the_run(own, folder, tmp_path, capfd):
    Path(own).write_text(RECIPE.replace("seed=1, size=32", "seed=1, size=33"))
    arguments = ["--recipe", own, "--data", str(folder), "--out", str(tmp_path / "run")]
    assert cli.main(arguments) == 1
    told = capfd.readouterr().err
    assert "33 is not a multiple of 32" in told
    assert "error: lime-render ended with status 2, as it says above" in told


def test_a_command_that_is_killed_is_told(monkeypatch, tmp_path):
    for number, words in ((9, "signal 9: was the memory used up"), (15, "signal 15; the same")):
        killed = type("Killed", (), {"wait": lambda self, number=number: -number})()
        monkeypatch.setattr(run.subprocess, "Popen", lambda *_, killed=killed, **__: killed)
        with pytest.raises(RuntimeError, match=f"lime-eval was ended by {words}"):
            run._run(("lime-eval",), tmp_path)


def test_a_recipe_that_is_terminated_ends_as_by_ctrl_c(monkeypatch, tmp_path, capfd):
    def terminated(*_, **__):
        os.kill(os.getpid(), signal.SIGTERM)

    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr(run, "carry_out", terminated)
    try:
        assert cli.main(["--recipe", "builtin", "--out", str(tmp_path / "run")]) == 130
    finally:
        signal.signal(signal.SIGTERM, before)
    assert "the same command goes on from here" in capfd.readouterr().err


def test_a_command_gets_time_to_end(monkeypatch):
    monkeypatch.setattr(run, "_SECONDS_TO_END", (0.1, 20))
    code = "import signal, time\nsignal.signal(signal.SIGINT, {})\nprint(1, flush=True)\n"
    for answer, status in (("lambda *_: exit(130)", 130), ("signal.SIG_IGN", -signal.SIGKILL)):
        words = [sys.executable, "-c", code.format(answer) + "time.sleep(60)"]
        process = subprocess.Popen(words, stdout=subprocess.PIPE)
        process.stdout.readline()
        if status < 0:
            monkeypatch.setattr(run, "_SECONDS_TO_END", (0.1, 0.1))
        run._end(process)
        assert process.returncode == status
        process.stdout.close()


@pytest.fixture
def packages(own, monkeypatch):
    """A recipe with cut-outs, whose packages are had as `hashes` says; those that were fetched."""
    fetched = []

    def fetch(packages, out):
        fetched.append([str(package) for package in packages])
        out.mkdir(parents=True, exist_ok=True)
        return [
            {"package": str(one), "ranges": list(one.ranges)} | fetch.found[one.client]
            for one in packages
        ]

    fetch.found, fetch.fetched = {"npm": {"sha256": "0"}, "apt": {"skipped": "x"}}, fetched
    monkeypatch.setattr(cutouts, "fetch", fetch)
    named = 'recipes.Package("npm", "things", "1"), recipes.Package("apt", "none", "2")'
    text = RECIPE.replace("average=0.5,", "average=0.5, cutouts=True,")
    text = text.replace("held_out=(2, 1),", f"held_out=(2, 1), packages=({named}),")
    Path(own).write_text(f"from lime_keras.train import recipes\n{text}")
    return fetch


def test_cutouts_are_downloaded_once(own, folder, commands, packages, tmp_path, capsys):
    packages.found["apt"] = {"sha256": "1"}
    first, second = tmp_path / "first", tmp_path / "second"
    for _ in range(2):
        run.carry_out(own, first, data_folder=folder)
    assert packages.fetched == [["npm things 1", "apt none 2"]]
    words = (first / "steps" / "trainings" / "masks.json").read_text()
    assert "--cutouts cutouts/things places" in words
    commands.ran.clear()
    run.carry_out(own, second, data_folder=folder, reuse=first)
    assert len(packages.fetched) == 1 and commands.ran == ["eval"]
    # The set's record lists the steps before the one that was taken over, and the cut-outs, too.
    made = [json.loads((one / "model" / "training.json").read_text()) for one in (first, second)]
    assert made[0]["steps"].keys() == made[1]["steps"].keys() == {"places", *ALL}
    assert made[0]["cutouts"] == made[1]["cutouts"] and len(made[0]["cutouts"]) == 2
    # Other pictures of the same packages are others.
    text = Path(own).read_text()
    Path(own).write_text(text.replace('"things", "1")', '"things", "1", ("a-b",))'))
    commands.ran.clear()
    run.carry_out(own, tmp_path / "third", data_folder=folder, reuse=first)
    assert len(packages.fetched) == 2
    assert commands.ran == ["trainings/masks", "trainings/rest", "eval"]
    Path(own).write_text(text)
    (first / "cutouts.json").write_text("[]")
    with pytest.raises(ValueError, match=r"cutouts.json cannot be read as the record of cut-outs"):
        run.carry_out(own, first, data_folder=folder)


def test_a_package_that_was_skipped_is_told_each_time(
    own, folder, commands, packages, tmp_path, capsys
):
    first = tmp_path / "first"
    for _ in range(2):
        run.carry_out(own, first, data_folder=folder)
        assert "skipped: apt none 2: x; masks learn without it" in capsys.readouterr().err
    # Another run takes over what there is, and tells it, too.
    run.carry_out(own, tmp_path / "second", data_folder=folder, reuse=first)
    assert len(packages.fetched) == 1
    assert "skipped: apt none 2: x; masks learn without it" in capsys.readouterr().err
    # Other packages, before anything is made, are fetched.
    commands.stop.add("corpora/own")
    third = tmp_path / "third"
    for version in ("2", "3"):
        text = Path(own).read_text()
        Path(own).write_text(text.replace(f'"none", "{version}"', f'"none", "{int(version) + 1}"'))
        with pytest.raises(KeyboardInterrupt):
            run.carry_out(own, third, data_folder=folder)
    assert packages.fetched[1:] == [["npm things 1", "apt none 3"], ["npm things 1", "apt none 4"]]


def test_lost_cutouts_are_downloaded_where_they_are_needed(
    own, folder, commands, packages, tmp_path
):
    out = tmp_path / "run"
    run.carry_out(own, out, data_folder=folder)
    shutil.rmtree(out / "cutouts")
    commands.ran.clear()
    run.carry_out(own, out, data_folder=folder)
    assert commands.ran == [] and len(packages.fetched) == 1
    for name in ("masks", "rest"):
        shutil.rmtree(out / "trainings" / name)
    packages.found["npm"] = {"sha256": "2"}
    with pytest.raises(
        RuntimeError, match=r"things is missing, .* as they were \(another file; x\)"
    ):
        run.carry_out(own, out, data_folder=folder)
    assert commands.ran == [] and not (out / "cutouts" / "things").exists()
    packages.found["npm"] = {"sha256": "0"}
    run.carry_out(own, out, data_folder=folder)
    assert commands.ran[-2:] == ["trainings/masks", "trainings/rest"]


def test_a_full_disk_is_no_missing_package(tmp_path, monkeypatch):
    def download(folder, client, *words):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(cutouts, "_run", download)
    with pytest.raises(OSError, match="No space left on device"):
        cutouts.fetch([recipe.Package("npm", "things", "1")], tmp_path / "things")


def test_packages_that_cannot_be_had_are_skipped_by_name(tmp_path, monkeypatch):
    def download(folder, client, *words):
        if client != "npm":
            raise FileNotFoundError(2, "No such file or directory", client)
        if words[-1].startswith("nothing"):
            return
        pictures = folder / "package" / "assets"
        pictures.mkdir(parents=True)
        for name in ("1f400.png", "1f43f.png", "1f43e-1.png", "1f43e.webp", "note.txt"):
            (pictures / name).write_text(name)
        shutil.make_archive(folder / "one", "gztar", folder, "package")
        (folder / "one.tar.gz").rename(folder / "one.tgz")

    monkeypatch.setattr(cutouts, "_run", download)
    packages = [
        recipe.Package("apt", "stamps", "1"),
        recipe.Package("npm", "nothing", "1"),
        recipe.Package("npm", "@a/emoji", "2", ("1f400-1f43e",)),
    ]
    stamps, nothing, emoji = cutouts.fetch(packages, tmp_path / "things")
    assert stamps["package"] == "apt stamps 1" and "apt-get" in stamps["skipped"]
    assert nothing["skipped"] == "the client left 0 archives in place of one"
    assert emoji["pictures"] == 2 and len(emoji["sha256"]) == 64
    left = sorted(path.name for path in (tmp_path / "things").rglob("*") if path.is_file())
    assert left == ["1f400.png", "1f43e.webp"]


@pytest.mark.slow
def test_a_recipe_makes_the_same_bytes_twice(own, folder, tmp_path):
    """From nothing to a set, by the commands themselves; the second time of the same corpora."""
    one, two = tmp_path / "one", tmp_path / "two"
    arguments = ["--recipe", own, "--data", str(folder), "--out"]
    assert cli.main([*arguments, str(one)]) == 0
    shutil.move(one / "steps" / "trainings", tmp_path / "trainings")
    assert cli.main([*arguments, str(two), "--reuse", str(one)]) == 0
    for place in ("onnx", "model"):
        names = sorted(path.name for path in (one / place).iterdir())
        assert len(names) > 5
        for name in names:
            same = (one / place / name).read_bytes() == (two / place / name).read_bytes()
            assert same or name == "training.json", name
    record = json.loads((two / "model" / "training.json").read_text())
    assert record["config"]["schedule"]["steps"] == 2
    assert json.loads((two / "eval" / "metrics.json").read_text())
