"""A corpus' files, and what is said when they are not there."""

import json

import pytest

from lime_keras.data import corpus


def write(folder, split, count):
    (folder / split).mkdir()
    for shard in range(count):
        corpus.shard_path(folder, split, shard).touch()
    manifest = json.dumps({"shards": count, "seed": 0})
    corpus.manifest_path(folder, split).write_text(manifest, encoding="utf-8")


def test_the_files_lie_where_the_documentation_says(tmp_path):
    assert corpus.shard_path(tmp_path, "train", 7) == tmp_path / "train" / "00007.tfrecord"
    assert corpus.shard_path(str(tmp_path), "test", 123456).name == "123456.tfrecord"
    assert corpus.manifest_path(tmp_path, "test") == tmp_path / "test" / "manifest.json"


@pytest.mark.parametrize("count", [0, 1, 12])
def test_a_complete_split_is_listed_in_order(tmp_path, count):
    write(tmp_path, "train", count)
    paths = corpus.shard_paths(tmp_path, "train")
    assert [path.name for path in paths] == [f"{shard:05d}.tfrecord" for shard in range(count)]
    assert corpus.read_manifest(tmp_path, "train") == {"shards": count, "seed": 0}


def test_files_that_the_manifest_does_not_know_are_left_out(tmp_path):
    write(tmp_path, "train", 2)
    corpus.shard_path(tmp_path, "train", 2).touch()
    (tmp_path / "train" / "partial-00003.tfrecord").touch()
    assert len(corpus.shard_paths(tmp_path, "train")) == 2


def test_a_split_without_its_manifest_names_the_command(tmp_path):
    write(tmp_path, "train", 2)
    corpus.manifest_path(tmp_path, "train").unlink()
    for split in corpus.SPLITS:
        with pytest.raises(FileNotFoundError, match=rf"manifest\.json.*lime-render.*{split}"):
            corpus.shard_paths(tmp_path, split)


def test_a_missing_shard_is_named(tmp_path):
    write(tmp_path, "test", 3)
    corpus.shard_path(tmp_path, "test", 1).unlink()
    with pytest.raises(FileNotFoundError, match=r"00001\.tfrecord is missing"):
        corpus.shard_paths(tmp_path, "test")
