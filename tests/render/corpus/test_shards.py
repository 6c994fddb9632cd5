"""A split's bytes: the same whatever the number of workers and interruptions."""

import dataclasses
import json
import multiprocessing
import os
import resource
import shutil
import signal
import threading
import time
from collections import Counter

import pytest
import tensorflow as tf
import trimesh
import worker_tasks
from in_process import InProcess
from render_scenes import write_inputs

from lime_keras.data import corpus, records
from lime_keras.render.corpus import processes, shards, sources


@pytest.fixture(autouse=True)
def environment_kept(monkeypatch):
    """`render_split` sets these for its workers."""
    for name in processes.THREAD_VARIABLES:
        monkeypatch.setenv(name, "1")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    return write_inputs(tmp_path_factory.mktemp("inputs"))


@pytest.fixture(scope="module")
def description(inputs, mitsuba_choice):
    return shards.Description(
        split="train",
        count=5,
        seed=0,
        size=64,
        shard_size=2,
        quality="fast",
        shading="furnace",
        shapes=str(inputs / "shapes"),
        environments=str(inputs / "environments"),
        backgrounds=None,
        variant=mitsuba_choice.variant,
    )


def nothing(done, total):
    """Follows no progress."""


def render(out, description, choice, workers=0, on_example=nothing, **options):
    """In worker processes, or without any in this one."""
    with pytest.MonkeyPatch.context() as patch:
        if not workers:
            patch.setattr(shards, "Workers", InProcess)
        return shards.render_split(
            out,
            description,
            choice,
            workers=workers,
            on_input=nothing,
            on_room=nothing,
            on_example=on_example,
            **options,
        )


def contents(out):
    return {path.name: path.read_bytes() for path in (out / "train").glob("*.tfrecord")}


@pytest.fixture(scope="module")
def rendered(tmp_path_factory, description, mitsuba_choice):
    """The corpus of no interruption, with what progress was told."""
    out, told = tmp_path_factory.mktemp("rendered"), []
    manifest = render(
        out, description, mitsuba_choice, on_example=lambda *told_: told.append(told_)
    )
    return out, manifest, told


def test_a_split_is_whole_and_its_manifest_tells_all(rendered, description):
    out, manifest, told = rendered
    assert manifest == corpus.read_manifest(out, "train")
    assert (manifest["shards"], manifest["examples"], manifest["failures"]) == (3, 5, [])
    recorded = dict(manifest["description"])
    assert manifest["inputs"]["shapes"].keys() == set(manifest["shapes"])
    assert manifest["inputs"]["environments"].keys() == set(manifest["lights"])
    assert all(len(digest) == 64 for digest in manifest["inputs"]["shapes"].values())
    assert manifest["skipped"] == {kind: {} for kind in manifest["inputs"]}
    # Folders are told by name alone: a corpus may be passed on.
    assert (recorded.pop("shapes"), recorded.pop("environments")) == ("shapes", "environments")
    assert recorded.items() <= vars(description).items()
    assert {"mitsuba", "numpy", "tensorflow"} <= set(manifest["packages"])
    assert told[0] == (0, 5) and told[-1] == (5, 5)
    names = {path.name for path in (out / "train").iterdir()}
    assert not [name for name in names if name.startswith("partial")]


def test_examples_are_in_order_and_tell_where_they_come_from(rendered):
    out, manifest, _ = rendered
    data = tf.data.TFRecordDataset([str(path) for path in corpus.shard_paths(out, "train")])
    examples = [records.parse(serialized) for serialized in data]
    assert [int(example["index"]) for example in examples] == list(range(5))
    for example in examples:
        assert example["image"].shape == (64, 64, 3) and int(example["seed"]) == 0
        assert example["shape"].numpy().decode() in manifest["shapes"]
        assert example["light"].numpy().decode() in manifest["lights"]
    assert len({float(example["shininess"]) for example in examples}) == 5


def test_two_workers_give_the_same_bytes_even_after_the_death_of_one(
    rendered, description, mitsuba_choice, tmp_path
):
    def kill_the_first():
        while not list((tmp_path / "train").glob("partial-*.tfrecord")):
            time.sleep(0.01)
        os.kill(multiprocessing.active_children()[0].pid, signal.SIGKILL)

    assassin = threading.Thread(target=kill_the_first)
    assassin.start()
    with pytest.raises(RuntimeError, match="a worker died"):
        render(tmp_path, description, mitsuba_choice, 1)
    assassin.join()
    assert not corpus.manifest_path(tmp_path, "train").exists()
    (tmp_path / "train" / "00002.json").unlink(missing_ok=True)
    for name in ("partial-1-00002.tfrecord", "00002.tfrecord"):  # neither is vouched for
        (tmp_path / "train" / name).write_bytes(b"cut off")
    assert render(tmp_path, description, mitsuba_choice, 2) == rendered[1]
    assert contents(tmp_path) == contents(rendered[0])
    assert not list((tmp_path / "train").glob("partial-*"))


def test_an_interruption_ends_the_processes(tmp_path):
    def interrupt(done, total):
        raise InterruptedError("in the middle")

    paths = [tmp_path / "one", tmp_path / "other"]
    pool = processes.Workers(2, worker_tasks.begin)
    with pytest.raises(InterruptedError):
        pool.run(worker_tasks.tell_and_wait, paths, 0, 2, interrupt)
    signed = [path.read_text() for path in paths if path.exists()]
    assert any(signed) and not multiprocessing.active_children()
    for number in filter(None, signed):
        with pytest.raises(ProcessLookupError):
            os.kill(int(number), 0)


def test_an_interrupted_split_goes_on(rendered, description, mitsuba_choice, tmp_path):
    def interrupt(done, total):
        if done > 2:  # one shard is finished
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(tmp_path, description, mitsuba_choice, on_example=interrupt)
    assert not corpus.manifest_path(tmp_path, "train").exists()
    first = tmp_path / "train" / "00000.tfrecord"
    written = first.stat().st_mtime_ns
    assert render(tmp_path, description, mitsuba_choice) == rendered[1]
    assert contents(tmp_path) == contents(rendered[0])
    assert first.stat().st_mtime_ns == written
    assert not list((tmp_path / "train").glob("partial-*"))


def test_a_file_that_kills_its_checker_is_named():
    pool = processes.Workers(1, shards._start_nothing)
    with pytest.raises(RuntimeError, match=r"a process died, .* at one of .*huge\.png"):
        pool.map(worker_tasks.die, [("backgrounds", "huge.png")], nothing)


def test_a_node_finds_the_files_that_were_checked_skipped_ones_too(
    description, mitsuba_choice, tmp_path
):
    """A node of a cluster lists and judges them anew."""
    for name in ("sound.png", "broken.png"):
        (tmp_path / name).write_bytes(b"")
    changed = shards.Description(**(vars(description) | {"backgrounds": str(tmp_path)}))
    job = shards._Job(tmp_path / "out", changed, mitsuba_choice)
    skipping = dataclasses.replace(job, usable=job.usable | {"backgrounds": ("sound.png",)})
    assert skipping.files() == job.files()
    assert [path.name for path in skipping.backgrounds.pictures()] == ["sound.png"]


def test_a_finished_split_is_left_alone(rendered, description, mitsuba_choice):
    out, manifest, _ = rendered
    times = {path: path.stat().st_mtime_ns for path in (out / "train").glob("*.tfrecord")}
    told = []
    again = render(out, description, mitsuba_choice, on_example=lambda *a: told.append(a))
    assert again == manifest
    assert {path: path.stat().st_mtime_ns for path in times} == times
    assert told[0] == (5, 5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed": 1}, "seed 0 there, 1 asked"),
        ({"shading": "literal", "size": 32}, "shading furnace .* literal .* size 64 there, 32"),
        ({"shapes": None}, "shapes shapes there, None asked"),
    ],
)
def test_other_options_in_the_same_folder_are_refused(
    rendered, description, mitsuba_choice, changes, message
):
    out = rendered[0]
    before = contents(out)
    other = shards.Description(**(vars(description) | changes))
    with pytest.raises(ValueError, match=f"holds another split: {message}"):
        render(out, other, mitsuba_choice)
    assert contents(out) == before


def test_another_seed_gives_other_bytes(rendered, description, mitsuba_choice, monkeypatch):
    """In this process, as a worker does it."""

    class Ticks:
        def put(self, _):
            pass

    def serialized(seed, index):
        other = shards.Description(**(vars(description) | {"seed": seed}))
        job = shards._Job(rendered[0], other, mitsuba_choice)
        return shards._Worker(job, Ticks()).record(index)[0]

    first_shard = corpus.shard_path(rendered[0], "train", 0)
    stored = next(iter(tf.data.TFRecordDataset(str(first_shard)))).numpy()
    assert serialized(0, 0) == stored
    assert serialized(1, 0) != stored != serialized(0, 1)


def test_a_scene_that_fails_is_drawn_anew_and_told(
    rendered, description, mitsuba_choice, monkeypatch
):
    worker = shards._Worker(shards._Job(rendered[0], description, mitsuba_choice), None)
    usable, calls = shards.examples.render, []

    def fails_once(*arguments, **options):
        calls.append(arguments)
        if len(calls) == 1:
            raise ValueError("the object covers 0.1% of the image")
        return usable(*arguments, **options)

    monkeypatch.setattr(shards.examples, "render", fails_once)
    serialized, [failure] = worker.record(3)
    assert int(records.parse(serialized)["index"]) == 3 and len(calls) == 2
    assert failure.pop("shape") in rendered[1]["shapes"]
    assert failure.pop("light") in rendered[1]["lights"]
    assert failure == {"index": 3, "attempt": 0, "error": "the object covers 0.1% of the image"}
    monkeypatch.setattr(shards, "_TRIES", 1)
    calls.clear()
    with pytest.raises(RuntimeError, match=r"example 3 of seed 0 failed 1 times, last of .*0\.1%"):
        worker.record(3)


def test_an_example_that_no_record_can_hold_is_drawn_anew_and_told(
    rendered, description, mitsuba_choice, monkeypatch
):
    worker = shards._Worker(shards._Job(rendered[0], description, mitsuba_choice), None)
    usable, calls = shards.examples.render, []

    def not_finite_once(*arguments, **options):
        calls.append(arguments)
        features = usable(*arguments, **options)
        if len(calls) == 1:
            features["mirror"][5, 5] = float("nan")
        return features

    monkeypatch.setattr(shards.examples, "render", not_finite_once)
    serialized, [failure] = worker.record(3)
    assert "mirror is not finite" in failure["error"]
    assert bool((records.parse(serialized)["mirror"] >= 0).numpy().all())


def test_a_shard_draws_from_a_part_of_many_files_and_the_split_from_all(
    rendered, description, mitsuba_choice, monkeypatch
):
    many = [f"{number:03d}.ply" for number in range(200)]
    monkeypatch.setattr(sources.ShapeSource, "names", lambda self: many)
    worker = shards._Worker(shards._Job(rendered[0], description, mitsuba_choice), None)
    drawn = [worker.drawn(shard)[0] for shard in range(30)]
    for names in drawn:
        assert len(set(names)) == shards._SHAPES_PER_SHARD and names == sorted(names)
    assert set().union(*drawn) == set(many)
    again = shards._Worker(shards._Job(rendered[0], description, mitsuba_choice), None)
    assert again.drawn(7)[0] == drawn[7] != drawn[8]
    assert worker.drawn(0)[1] == rendered[1]["lights"]  # few: all of them


def test_a_full_disk_is_told_and_loses_no_finished_shard(
    rendered, description, mitsuba_choice, tmp_path
):
    """A limit on the size of files, which the worker inherits, stands for the disk."""
    sizes = [len(held) for held in contents(rendered[0]).values()]
    out = tmp_path / "corpus"
    shutil.copytree(rendered[0], out)
    for gone in ("00001.tfrecord", "00001.json", "manifest.json"):
        (out / "train" / gone).unlink()
    before = {path: path.read_bytes() for path in (out / "train").iterdir()}
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (min(sizes) // 2, unlimited[1]))
    try:
        with pytest.raises(
            RuntimeError, match=r"00001\.tfrecord cannot be written.*Finished shards are kept"
        ):
            render(out, description, mitsuba_choice, 1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
    assert {path: path.read_bytes() for path in (out / "train").iterdir()} == before


def test_a_shard_count_that_does_not_divide_is_rounded_up(description):
    ranges = [description.indices(shard) for shard in range(description.shards)]
    assert [list(indices) for indices in ranges] == [[0, 1], [2, 3], [4]]


def test_the_claim_is_plain_json(rendered, description):
    text = (rendered[0] / "train" / "description.json").read_text(encoding="utf-8")
    assert json.loads(text) == rendered[1]["description"]


def test_files_that_moved_to_the_other_split_are_refused(
    rendered, description, mitsuba_choice, inputs, tmp_path
):
    """Training has seen them: they may not be tested on, under whatever name."""
    moved = tmp_path / "shapes"
    for split in corpus.SPLITS:
        (moved / split).mkdir(parents=True)
    for path in (inputs / "shapes").iterdir():
        shutil.copy(path, moved / "test" / f"copy of {path.name}")
    shutil.copy(inputs / "shapes" / "ball.ply", moved / "train")
    out = tmp_path / "corpus"
    shutil.copytree(rendered[0], out)
    changes = {"split": "test", "shapes": str(moved)}
    other = shards.Description(**(vars(description) | changes))
    with pytest.raises(ValueError, match=r"copy of .* has the contents of .*the train split"):
        render(out, other, mitsuba_choice)
    # While that split is being rendered, too: it has no manifest yet.
    corpus.manifest_path(out, "train").unlink()
    with pytest.raises(ValueError, match="has the contents of"):
        render(out, other, mitsuba_choice)
    assert not (out / "test").exists()


def test_files_of_one_name_may_differ_between_the_splits(
    rendered, description, mitsuba_choice, inputs, tmp_path
):
    name, *_ = rendered[1]["shapes"]
    sorted_by_hand = tmp_path / "shapes"
    for split in corpus.SPLITS:
        (sorted_by_hand / split).mkdir(parents=True)
    shutil.copy(inputs / "shapes" / name, sorted_by_hand / "train")
    trimesh.creation.icosphere(subdivisions=2).export(sorted_by_hand / "test" / name)
    out = tmp_path / "corpus"
    shutil.copytree(rendered[0], out)
    changes = {"split": "test", "shapes": str(sorted_by_hand), "count": 1}
    other = shards.Description(**(vars(description) | changes))
    manifest = render(out, other, mitsuba_choice)
    assert manifest["shapes"] == [name]
    assert manifest["inputs"]["shapes"][name] != rendered[1]["inputs"]["shapes"][name]


def test_files_that_come_while_it_renders_change_no_byte_and_are_told(
    rendered, description, mitsuba_choice, inputs, tmp_path, monkeypatch
):
    """Each shard is rendered by a worker of its own, some of them begun when it has come."""
    monkeypatch.setattr(processes, "TASKS_PER_PROCESS", 1)
    grown = tmp_path / "inputs"
    shutil.copytree(inputs, grown)
    changes = {kind: str(grown / kind) for kind in ("shapes", "environments")}
    (grown / "shapes" / "test").mkdir()  # dealt by hand: what comes is for this split
    (grown / "shapes" / "train").mkdir()
    names = rendered[1]["shapes"]
    for name in names:
        shutil.move(grown / "shapes" / name, grown / "shapes" / "train" / name)

    def another_comes(done, total):
        if done == 2:
            shutil.copy(inputs / "shapes" / names[0], grown / "shapes" / "train" / "aaa.ply")

    grown_description = shards.Description(**(vars(description) | changes))
    with pytest.raises(ValueError, match=r"aaa\.ply came or went"):
        render(tmp_path / "out", grown_description, mitsuba_choice, on_example=another_comes)
    assert contents(tmp_path / "out") == contents(rendered[0])
    assert not corpus.manifest_path(tmp_path / "out", "train").exists()
    (grown / "shapes" / "train" / "aaa.ply").unlink()
    assert render(tmp_path / "out", grown_description, mitsuba_choice) == rendered[1]


def test_a_second_process_is_kept_out_and_disturbs_nothing(
    rendered, description, mitsuba_choice, tmp_path
):
    out, told = tmp_path / "corpus", []
    shutil.copytree(rendered[0], out)
    for gone in ("00001.tfrecord", "00001.json", "manifest.json"):
        (out / "train" / gone).unlink()

    def render_again(done, total):
        if done == 4 and not told:  # in the middle of the missing shard
            told.append(True)
            with pytest.raises(RuntimeError, match=r"another lime-render is rendering .*train"):
                render(out, description, mitsuba_choice)

    render(out, description, mitsuba_choice, on_example=render_again)
    assert told and contents(out) == contents(rendered[0])


def test_shards_of_other_software_are_told_in_the_manifest(
    rendered, description, mitsuba_choice, tmp_path
):
    out = tmp_path / "corpus"
    shutil.copytree(rendered[0], out)
    sidecar = out / "train" / "00001.json"
    held = json.loads(sidecar.read_text(encoding="utf-8"))
    held["packages"]["numpy"] = "1.0"
    sidecar.write_text(json.dumps(held), encoding="utf-8")
    manifest = render(out, description, mitsuba_choice)
    assert manifest["packages"] == rendered[1]["packages"] | {
        "numpy": f"1.0, {rendered[1]['packages']['numpy']}"
    }


def test_a_broken_description_is_told_by_name(description, mitsuba_choice, tmp_path):
    (tmp_path / "train").mkdir()
    (tmp_path / "train" / "description.json").write_text("{", encoding="utf-8")
    with pytest.raises(ValueError, match=r"description\.json is broken"):
        render(tmp_path, description, mitsuba_choice)


def test_processes_are_replaced_without_waiting_for_ever(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "TASKS_PER_PROCESS", 2)
    paths = [tmp_path / str(number) for number in range(5)]
    processes.Workers(1, shards._start_nothing).run(worker_tasks.sign, paths, 0, 5, nothing)
    signed = [path.read_text() for path in paths]
    assert sorted(Counter(signed).values()) == [1, 2, 2]
    assert str(os.getpid()) not in signed
