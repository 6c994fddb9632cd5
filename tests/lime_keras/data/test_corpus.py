"""A corpus' files, and what is said when they are not there."""

import json

import pytest

from lime_keras.data.corpus import SPLITS, Split

DESCRIPTION = {"size": 64, "shard_size": 1, "shading": "furnace"}


def write(folder, split, count, **manifest):
    (folder / split).mkdir(parents=True)
    written = Split(folder, split)
    for shard in range(count):
        written.shard_path(shard).touch()
    whole = {"shards": count, "examples": count, "description": DESCRIPTION} | manifest
    written.manifest_path.write_text(json.dumps(whole), encoding="utf-8")
    return written


def test_the_files_lie_where_the_documentation_says(tmp_path):
    split, folder = Split(tmp_path, "train"), tmp_path / "train"
    assert split.shard_path(7) == folder / "00007.tfrecord"
    assert split.sidecar_path(7) == folder / "00007.json"
    assert Split(str(tmp_path), "test").shard_path(123456).name == "123456.tfrecord"
    paths = (split.manifest_path, split.description_path, split.inputs_path)
    assert paths == tuple(folder / f"{name}.json" for name in ("manifest", "description", "inputs"))


@pytest.mark.parametrize("count", [0, 1, 12])
def test_a_complete_split_is_listed_in_order(tmp_path, count):
    paths = write(tmp_path, "train", count).shard_paths()
    assert [path.name for path in paths] == [f"{shard:05d}.tfrecord" for shard in range(count)]
    assert Split(tmp_path, "train").manifest["shards"] == count


def test_files_that_the_manifest_does_not_know_are_left_out(tmp_path):
    split = write(tmp_path, "train", 2)
    split.shard_path(2).touch()
    (tmp_path / "train" / "partial-00003.tfrecord").touch()
    assert len(split.shard_paths()) == 2


def test_a_split_tells_what_it_holds(tmp_path):
    description = {"size": 64, "shard_size": 2, "shading": "furnace"}
    recorded = {"examples": 3, "sha256": ["a", "b"], "inputs": {"shapes": {"ball.ply": "c"}}}
    split = write(tmp_path, "test", 2, description=description, **recorded)
    assert (split.count, split.size, split.shard_size) == (3, 64, 2)
    assert (split.sha256, split.inputs) == (recorded["sha256"], recorded["inputs"])


@pytest.mark.parametrize("examples", [0, 2, 5, 10**9])
def test_numbers_that_contradict_each_other_are_told(tmp_path, examples):
    split = write(tmp_path, "test", 2, description={"shard_size": 2}, examples=examples)
    told = rf"manifest\.json contradicts itself: {examples} examples do not make 2 shards of 2"
    with pytest.raises(ValueError, match=told):
        split.shard_paths()


@pytest.mark.parametrize("examples", [3, 4])
def test_the_last_shard_may_be_short(tmp_path, examples):
    split = write(tmp_path, "test", 2, description={"shard_size": 2}, examples=examples)
    assert len(split.shard_paths()) == 2


def test_the_lobe_is_told_and_was_the_furnaces_where_a_description_does_not_say(tmp_path):
    for split, said, lobe in (
        ("train", {}, "furnace"),
        ("test", {"shading": "printed"}, "printed"),
    ):
        assert write(tmp_path, split, 1, description=said).lobe == lobe
    literal = write(tmp_path / "other", "test", 1, description={"shading": "literal"})
    with pytest.raises(ValueError, match=rf"{literal.folder} has a lobe literal, .*: render it"):
        _ = literal.lobe


def test_a_split_without_its_manifest_names_the_command(tmp_path):
    write(tmp_path, "train", 2).manifest_path.unlink()
    for name in SPLITS:
        with pytest.raises(FileNotFoundError, match=rf"manifest\.json.*lime-render.*{name}"):
            Split(tmp_path, name).shard_paths()


def test_a_missing_shard_is_named(tmp_path):
    split = write(tmp_path, "test", 3)
    split.shard_path(1).unlink()
    with pytest.raises(FileNotFoundError, match=r"00001\.tfrecord is missing"):
        split.shard_paths()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "cannot be read as a manifest.*delete it"),
        ("[]", "cannot be read as a manifest.*delete it"),
        ("[" * 100_000, "cannot be read as a manifest.*nested too deeply.*delete it"),
        ("{}", "is no manifest"),
        ('{"shards": "two"}', "is no manifest"),
        ('{"shards": 1, "description": []}', "is no manifest"),
    ],
)
def test_what_is_no_manifest_is_named(tmp_path, content, message):
    split = write(tmp_path, "test", 1)
    split.manifest_path.write_text(content, encoding="utf-8")
    with pytest.raises(ValueError, match=rf"test/manifest\.json {message}"):
        assert split.shard_paths() and split.size


def test_a_billion_shards_are_not_waited_for(tmp_path):
    split = write(tmp_path, "test", 1, shards=10**9, examples=10**9)
    with pytest.raises(FileNotFoundError, match=r"00001\.tfrecord is missing"):
        split.shard_paths()


@pytest.mark.parametrize(
    "content, name",
    [
        ({"sha256": [1]}, "sha256"),
        ({"inputs": {"shapes": []}}, "inputs"),
        ({"inputs": {"shapes": {"a": 3}}}, "inputs"),
        ({"description": {"size": "big"}}, "size"),
        ({"description": {}}, "size"),
    ],
)
def test_values_of_another_kind_are_refused(content, name, tmp_path):
    split = write(tmp_path, "test", 1, **content)
    with pytest.raises(ValueError, match=r"manifest\.json is no manifest of `lime-render`"):
        getattr(split, name)


def test_images_that_networks_cannot_take_are_refused_with_their_mend(tmp_path):
    split = write(tmp_path, "test", 1)
    split.check_size(32)
    with pytest.raises(ValueError, match=r"images of 64 pixels.*lime-render --size 48"):
        split.check_size(48)
