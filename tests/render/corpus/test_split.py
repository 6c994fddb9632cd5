"""A split's bytes: the same whatever the number of workers and interruptions."""

import dataclasses
import json
import shutil

import full_disk
import json_files
import numpy as np
import pytest
import tensorflow as tf
import trimesh
from in_process import InProcess
from no_progress import nothing
from render_scenes import describe, write_inputs

from lime_keras.data import records
from lime_keras.data.corpus import SPLITS, Split
from lime_keras.render.corpus import split
from lime_keras.render.corpus.random_example import render_example
from lime_keras.render.corpus.worker import sources_of
from lime_keras.render.inspect import verification
from lime_keras.render.jobs import inputs as split_inputs
from lime_keras.render.jobs import processes, resuming
from lime_keras.render.jobs.description import Job


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
    return describe(inputs, 5, mitsuba_choice.variant)


def render(out, description, choice, workers=0, on_example=nothing, **options):
    """In worker processes, or without any in this one."""
    with pytest.MonkeyPatch.context() as patch:
        if not workers:
            patch.setattr(split, "Pool", InProcess)
        return split.render_split(
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
    assert manifest == Split(out, "train").manifest
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
    data = tf.data.TFRecordDataset([str(path) for path in Split(out, "train").shard_paths()])
    examples = [records.parse(serialized) for serialized in data]
    assert [int(example["index"]) for example in examples] == list(range(5))
    for example in examples:
        assert example["image"].shape == (64, 64, 3) and int(example["seed"]) == 0
        assert example["shape"].numpy().decode() in manifest["shapes"]
        assert example["light"].numpy().decode() in manifest["lights"]
    assert len({float(example["shininess"]) for example in examples}) == 5


def test_two_workers_give_the_same_bytes_beside_what_was_cut_off(
    rendered, description, mitsuba_choice, tmp_path
):
    shutil.copytree(rendered[0], tmp_path, dirs_exist_ok=True)
    folder = tmp_path / "train"
    for gone in ("00001.tfrecord", "00001.json", "00002.json", "manifest.json"):
        (folder / gone).unlink()
    for name in ("partial-1-00002.tfrecord", "00002.tfrecord"):  # neither has a sidecar
        (folder / name).write_bytes(b"cut off")
    assert render(tmp_path, description, mitsuba_choice, 2) == rendered[1]
    assert contents(tmp_path) == contents(rendered[0])
    assert not list(folder.glob("partial-*"))


def test_an_interrupted_split_goes_on(rendered, description, mitsuba_choice, tmp_path):
    def interrupt(done, total):
        if done > 2:  # one shard is finished
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(tmp_path, description, mitsuba_choice, on_example=interrupt)
    assert not Split(tmp_path, "train").manifest_path.exists()
    first = tmp_path / "train" / "00000.tfrecord"
    written = first.stat().st_mtime_ns
    assert render(tmp_path, description, mitsuba_choice) == rendered[1]
    assert contents(tmp_path) == contents(rendered[0])
    assert first.stat().st_mtime_ns == written
    assert not list((tmp_path / "train").glob("partial-*"))


def test_parts_give_the_bytes_of_one_run_though_they_go_on_at_once(
    rendered, description, mitsuba_choice, tmp_path
):
    """The second part begins and ends while the first one writes its second shard."""
    folder, told = tmp_path / "train", []

    def another_begins(done, total):
        told.append((done, total))
        if done != 3 or len(told) > 4:
            return
        [writing] = folder.glob("partial-*-00002.tfrecord")
        for part, locked in (((1, 1), "train"), ((1, 2), "part-1-of-2")):
            with pytest.raises(RuntimeError, match=f"another lime-render .*{locked}: wait for it"):
                render(tmp_path, description, mitsuba_choice, part=part)
        with pytest.raises(ValueError, match="seed 0 there, 1 asked"):
            other = dataclasses.replace(description, seed=1)
            render(tmp_path, other, mitsuba_choice, part=(2, 2))
        assert render(tmp_path, description, mitsuba_choice, part=(2, 2)) is None
        assert writing.exists() and not Split(tmp_path, "train").manifest_path.exists()

    manifest = render(tmp_path, description, mitsuba_choice, on_example=another_begins, part=(1, 2))
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3), (3, 3)]
    assert manifest == Split(tmp_path, "train").manifest == rendered[1]
    names = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert names == {path.name: path.read_bytes() for path in (rendered[0] / "train").iterdir()}


def test_a_killed_part_goes_on_and_leaves_the_others_partial_files_alone(
    rendered, description, mitsuba_choice, tmp_path
):
    shutil.copytree(rendered[0], tmp_path, dirs_exist_ok=True)
    folder = tmp_path / "train"
    for gone in ("00001.tfrecord", "00001.json", "00002.json", "manifest.json"):
        (folder / gone).unlink()
    (folder / "part-2-of-2").mkdir()
    own, others = (folder / f"partial-1-0000{shard}.tfrecord" for shard in (1, 2))
    for path in (own, others):
        path.write_bytes(b"cut off")
    assert render(tmp_path, description, mitsuba_choice, part=(2, 2)) is None
    assert others.exists() and not own.exists()
    assert render(tmp_path, description, mitsuba_choice, part=(1, 2)) == rendered[1]
    assert {path.name for path in folder.iterdir()} == {
        path.name for path in (rendered[0] / "train").iterdir()
    }


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
        ({"quality": "reference", "size": 32}, "quality fast .* reference .* size 64 there, 32"),
        ({"shapes": None}, "shapes shapes there, None asked"),
        ({"materials": "natural"}, "materials uniform there, natural asked"),
    ],
)
def test_other_options_in_the_same_folder_are_refused(
    rendered, description, mitsuba_choice, changes, message
):
    out = rendered[0]
    before = contents(out)
    other = dataclasses.replace(description, **changes)
    with pytest.raises(ValueError, match=f"holds another split: {message}"):
        render(out, other, mitsuba_choice)
    assert contents(out) == before


def test_other_options_that_came_while_inputs_were_checked_are_refused(
    description, mitsuba_choice, tmp_path, monkeypatch
):
    def inspected(files, *_):
        path = Split(tmp_path, description.split).description_path
        resuming.write_json(path, description.recorded() | {"seed": 99})
        return {kind: [] for kind in files}

    monkeypatch.setattr(split, "_inspect", inspected)
    with pytest.raises(ValueError, match="seed 99 there, "):
        render(tmp_path, description, mitsuba_choice)


def test_an_example_alone_is_that_of_the_shard_field_by_field(
    rendered, description, mitsuba_choice
):
    """In this process, as a notebook renders it."""
    job = Job(rendered[0], description, mitsuba_choice, description.files())
    sources = sources_of(job)
    shards = tf.data.TFRecordDataset([str(path) for path in job.split.shard_paths()])
    stored = list(shards.as_numpy_iterator())
    for index in (0, 3):
        example = render_example(index, sources, size=64, shard_size=2)
        assert not example.failures and example.record == stored[index]
        alone, held = records.parse(records.encode(example.features)), records.parse(stored[index])
        for name in records.FEATURES:
            np.testing.assert_array_equal(alone[name], held[name], err_msg=name)
    anew = dataclasses.replace(job, description=dataclasses.replace(description, seed=1))
    other = render_example(0, sources_of(anew), size=64, shard_size=2)
    assert other.record != stored[0]


def test_a_full_disk_is_told_and_loses_no_finished_shard(
    rendered, description, mitsuba_choice, tmp_path
):
    """A limit on the size of files stands for the disk."""
    sizes = [len(held) for held in contents(rendered[0]).values()]
    out = tmp_path / "corpus"
    shutil.copytree(rendered[0], out)
    for gone in ("00001.tfrecord", "00001.json", "manifest.json"):
        (out / "train" / gone).unlink()
    before = {path: path.read_bytes() for path in (out / "train").iterdir()}
    told = r"00001\.tfrecord cannot be written.*Finished shards are kept"
    with pytest.raises(RuntimeError, match=told), full_disk.files_end_after(min(sizes) // 2):
        render(out, description, mitsuba_choice)
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
    for name in SPLITS:
        (moved / name).mkdir(parents=True)
    for path in (inputs / "shapes").iterdir():
        shutil.copy(path, moved / "test" / f"copy of {path.name}")
    shutil.copy(inputs / "shapes" / "ball.ply", moved / "train")
    out = tmp_path / "corpus"
    shutil.copytree(rendered[0], out)
    other = dataclasses.replace(description, split="test", shapes=str(moved))
    with pytest.raises(ValueError, match=r"copy of .* has the contents of .*the train split"):
        render(out, other, mitsuba_choice)
    # While that split is being rendered, too: it has no manifest yet.
    Split(out, "train").manifest_path.unlink()
    with pytest.raises(ValueError, match="has the contents of"):
        render(out, other, mitsuba_choice)
    assert not (out / "test").exists()


def test_files_of_one_name_may_differ_between_the_splits(
    rendered, description, mitsuba_choice, inputs, tmp_path
):
    name, *_ = rendered[1]["shapes"]
    sorted_by_hand = tmp_path / "shapes"
    for half in SPLITS:
        (sorted_by_hand / half).mkdir(parents=True)
    shutil.copy(inputs / "shapes" / name, sorted_by_hand / "train")
    trimesh.creation.icosphere(subdivisions=2).export(sorted_by_hand / "test" / name)
    out = tmp_path / "corpus"
    shutil.copytree(rendered[0], out)
    changes = {"split": "test", "shapes": str(sorted_by_hand), "count": 1}
    other = dataclasses.replace(description, **changes)
    manifest = render(out, other, mitsuba_choice)
    assert manifest["shapes"] == [name]
    assert manifest["inputs"]["shapes"][name] != rendered[1]["inputs"]["shapes"][name]


@pytest.fixture(scope="module")
def varied(rendered, description, mitsuba_choice, tmp_path_factory):
    """A corpus of rooms and endless bodies, and its manifest.

    The rooms are the user's map, under their names: to render them takes a minute.
    """
    out = tmp_path_factory.mktemp("varied")
    changes = {"light_law": "mixed", "endless": 1.0, "shard_size": 8, "count": 10}
    more = dataclasses.replace(description, **changes)
    sources, folder = sources_of(Job(out, more, mitsuba_choice)), more.folder("environments")
    sources.rooms.mkdir(parents=True)
    for name in sources.room_names:
        shutil.copy(folder / rendered[1]["lights"][0], sources.rooms / name)
    return out, render(out, more, mitsuba_choice), more, sources.light_names


def test_a_varied_split_lists_what_it_is_made_of_and_is_sound(rendered, varied):
    out, manifest, _, light_names = varied
    assert manifest["description"]["light_law"] == "mixed" and manifest["failures"] == []
    assert manifest["lights"] == [*rendered[1]["lights"], *light_names]
    assert len(manifest["lights"]) == 1 + 40 + 48
    own = rendered[1]["shapes"]
    assert manifest["shapes"][: len(own)] == own
    assert all(name.startswith("endless-0000") for name in manifest["shapes"][len(own) :])
    assert list(verification.verify(out, "train", nothing)) == []


@pytest.mark.slow
def test_two_workers_give_the_bytes_of_a_varied_split(varied, mitsuba_choice, tmp_path):
    out, manifest, description, _ = varied
    shutil.copytree(out / "train" / "rooms", tmp_path / "train" / "rooms")
    assert render(tmp_path, description, mitsuba_choice, 2) == manifest
    assert contents(tmp_path) == contents(out)


def test_a_split_of_single_maps_is_described_as_before_and_draws_as_before(rendered, description):
    """Corpora that were begun go on, and test splits keep their scenes.

    Bytes depend on the processor's rounding, too, so the drawn numbers stand here.
    """
    recorded = rendered[1]["description"]
    assert not {"light_law", "endless", "light_split", "shape_count"} & recorded.keys()
    serialized = next(iter(tf.data.TFRecordDataset(str(Split(rendered[0], "train").shard_path(0)))))
    example = records.parse(serialized)
    assert (example["shape"].numpy(), example["light"].numpy()) == (b"ball.ply", b"map0.exr")
    drawn = [*example["camera"].numpy(), *example["diffuse_albedo"].numpy()]
    drawn += [example[name].numpy() for name in ("specular_albedo", "shininess", "ambient")]
    drawn += [example[name].numpy().mean() for name in ("image", "mask", "diffuse_shading")]
    pinned = [142.1143, 142.1143, 11.72828, 25.96969]
    pinned += [0.4234111, 0.4342457, 0.3239408, 0.6191571, 2.540985, 0.01562816]
    np.testing.assert_allclose(drawn, [*pinned, 0.5241287, 0.4579532, 0.3900922], rtol=1e-4)


@pytest.fixture(scope="module")
def under_known_lights(rendered, description, mitsuba_choice, tmp_path_factory):
    """The corpus with a test split of the other shape under the lights of its train split."""
    out = tmp_path_factory.mktemp("known") / "corpus"
    shutil.copytree(rendered[0], out)
    known = dataclasses.replace(description, split="test", light_split="train", count=3)
    manifest = render(out, known, mitsuba_choice)
    return out, manifest


def test_a_test_split_under_known_lights_has_the_train_splits_newly_turned(
    rendered, under_known_lights
):
    out, manifest = under_known_lights
    assert manifest["lights"] == rendered[1]["lights"]
    assert manifest["inputs"]["environments"] == rendered[1]["inputs"]["environments"]
    assert not set(manifest["shapes"]) & set(rendered[1]["shapes"])
    for name in SPLITS:
        described = Split(out, name).manifest["description"]
        assert described.get("light_split", name) == "train"
        assert list(verification.verify(out, name, nothing)) == []
    turned = [
        records.parse(serialized)["environment"].numpy()
        for name in SPLITS
        for serialized in tf.data.TFRecordDataset([*map(str, Split(out, name).shard_paths())])
    ]
    assert len({one.tobytes() for one in turned}) == len(turned) == 8


def test_other_lights_than_the_train_splits_are_refused_as_known_ones(
    under_known_lights, description, mitsuba_choice, inputs, tmp_path
):
    out = tmp_path / "corpus"
    shutil.copytree(under_known_lights[0], out)
    # Verification finds them, and so does rendering, whichever split comes last.
    path = Split(out, "test").inputs_path
    path.write_text(path.read_text(encoding="utf-8").replace('"sha256": "', '"sha256": "f'))
    with json_files.edited(Split(out, "test").manifest_path) as content:
        digests = content["inputs"]["environments"]
        digests |= {name: f"f{digest}" for name, digest in digests.items()}
    [(kind, text)] = verification.verify(out, "train", nothing)
    assert kind == "split" and "the same lights, by --lights known" in text
    shutil.rmtree(out / "train")
    with pytest.raises(ValueError, match="are to have the same lights, by --lights known"):
        render(out, description, mitsuba_choice)
    # Built-in rooms follow from the seed and their number.
    built_in = {"environments": None, "shapes": None, "light_split": "train", "split": "test"}
    begun = tmp_path / "begun"
    resuming.write_json(begun / "train" / "description.json", {"seed": 0, "light_count": 45})
    resuming.write_json(
        begun / "train" / "inputs.json", {"shapes": [], "environments": [], "backgrounds": []}
    )
    for changes in ({"light_count": 44}, {"light_count": 45, "seed": 1}):
        other = dataclasses.replace(description, **built_in, **changes)
        with pytest.raises(ValueError, match="the same --seed and --light-count"):
            render(begun, other, mitsuba_choice)


def test_known_lights_of_a_test_split_are_the_rooms_of_the_train_split(description, tmp_path):
    built_in = {"environments": None, "shapes": None, "shape_count": 5, "light_count": 45}
    jobs = [
        Job(tmp_path, dataclasses.replace(description, **built_in, **changes), None)
        for changes in ({}, {"split": "test", "light_split": "train"})
    ]
    train, test = map(sources_of, jobs)
    assert train.light_names == test.light_names and len(test.light_names) == 45
    # The usual number is the same, said or not.
    described = {"seed": 0, "light_split": "train"}, {"seed": 0, "light_count": 40}
    assert not list(split_inputs.clashes(described, ({}, {})))
    mixed = described[0], described[1] | {"light_law": "mixed"}
    assert "--light-law maps" in next(split_inputs.clashes(mixed, ({}, {})))
    assert train._light_split == test._light_split == "train" and train.seed == test.seed
    names = [train.shape_names, test.shape_names]
    assert [len(one) for one in names] == [5, 5] and not set(names[0]) & set(names[1])
    # What is not asked for is not recorded, so that a split that was begun goes on.
    assert not {"light_split"} & jobs[0].description.recorded().keys()


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

    grown_description = dataclasses.replace(description, **changes)
    with pytest.raises(ValueError, match=r"aaa\.ply came or went"):
        render(tmp_path / "out", grown_description, mitsuba_choice, on_example=another_comes)
    assert contents(tmp_path / "out") == contents(rendered[0])
    assert not Split(tmp_path / "out", "train").manifest_path.exists()
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
    with json_files.edited(out / "train" / "00001.json") as held:
        held["packages"]["numpy"] = "1.0"
    manifest = render(out, description, mitsuba_choice)
    assert manifest["packages"] == rendered[1]["packages"] | {
        "numpy": f"1.0, {rendered[1]['packages']['numpy']}"
    }


def test_shards_without_a_description_are_not_taken_over(
    rendered, description, mitsuba_choice, tmp_path
):
    out = tmp_path / "corpus"
    shutil.copytree(rendered[0], out)
    Split(out, "train").description_path.unlink()
    with pytest.raises(ValueError, match=r"holds shards and no description\.json"):
        render(out, description, mitsuba_choice)


def test_a_broken_description_is_told_by_name(description, mitsuba_choice, tmp_path):
    (tmp_path / "train").mkdir()
    (tmp_path / "train" / "description.json").write_text("{", encoding="utf-8")
    with pytest.raises(ValueError, match=r"description\.json cannot be read as a description"):
        render(tmp_path, description, mitsuba_choice)
