"""A corpus of a bank's scenes: the scenes that training makes, in records that verify."""

import json

import numpy as np
import pytest

from lime_keras.data import pipeline, records
from lime_keras.data.corpus import Split
from lime_keras.render import cli
from lime_keras.render.corpus import from_bank
from lime_keras.render.inspect import verification
from lime_keras.synthesis.scenes import Scenes
from tests.fixtures import sphere_bank

SIZE, COUNT, SHARD = 32, 22, 8


def make(bank, out, **options):
    options = {"count": COUNT, "seed": 5, "shard_size": SHARD, "tell": lambda *_: None} | options
    return from_bank.make_split(bank, out, **options)


@pytest.fixture(scope="module")
def bank(tmp_path_factory):
    return sphere_bank.write(tmp_path_factory.mktemp("bank"), size=SIZE)


@pytest.fixture(scope="module")
def corpus(bank, tmp_path_factory):
    out = tmp_path_factory.mktemp("corpus") / "scenes"
    make(bank, out)
    return out


def stored(corpus):
    shards = Split(corpus, "train").shard_paths()
    [batch] = pipeline.evaluation(shards, size=SIZE, batch_size=COUNT, features=records.FEATURES)
    return {name: value.numpy() for name, value in batch.items()}


def test_the_records_are_the_scenes_that_training_makes(bank, corpus):
    scenes = Scenes(bank, size=SIZE, camera=False, features=records.FEATURES)
    made = {name: np.asarray(v) for name, v in scenes.make(scenes.draw(5, np.arange(24))).items()}
    held = stored(corpus)
    for name in records.FEATURES:
        if made[name].dtype.kind in "US":
            assert [text.decode() for text in held[name]] == list(made[name][:COUNT])
        else:
            half = {"rtol": 1e-3, "atol": 0.51 / 255}
            np.testing.assert_allclose(held[name], made[name][:COUNT], **half, err_msg=name)


def test_every_record_verifies(corpus):
    found = verification.verify(corpus, "train", lambda *_: None)
    # The fixture's normals are of a sphere's outermost pixels; 12 bits turn some away.
    assert [line for line in found.lines() if not line.startswith("normal")] == []
    assert found.examples == COUNT


def test_training_reads_the_corpus(corpus):
    training, held_out = pipeline.training_shards(corpus)
    assert len(training) == 2 and len(held_out) == 1
    [batch] = pipeline.training(training, size=SIZE, batch_size=4, seed=0).take(1)
    assert batch["image"].shape == (4, SIZE, SIZE, 3)


@pytest.mark.slow
def test_a_shard_that_was_lost_is_made_again(bank, corpus, tmp_path):
    make(bank, tmp_path)
    split = Split(tmp_path, "train")
    split.shard_path(1).unlink()
    make(bank, tmp_path)
    assert split.shard_path(1).read_bytes() == Split(corpus, "train").shard_path(1).read_bytes()


@pytest.mark.slow
def test_an_interrupted_command_goes_on(bank, corpus, tmp_path):
    def interrupt(done, total):
        if done > SHARD:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make(bank, tmp_path, tell=interrupt)
    split = Split(tmp_path, "train")
    assert not split.manifest_path.exists() and split.shard_path(0).is_file()
    assert not split.shard_path(1).exists()
    before = split.shard_path(0).stat().st_mtime_ns
    manifest = make(bank, tmp_path)
    assert split.shard_path(0).stat().st_mtime_ns == before
    assert manifest["sha256"] == Split(corpus, "train").sha256
    assert not list(split.folder.glob("partial-*"))


def test_another_split_in_the_folder_is_refused(bank, corpus):
    with pytest.raises(ValueError, match="seed 5 there, 6 asked"):
        make(bank, corpus, seed=6)
    with pytest.raises(ValueError, match="materials uniform there, natural asked"):
        make(bank, corpus, materials="natural")


@pytest.mark.slow
def test_natural_materials(bank, tmp_path):
    make(bank, tmp_path, materials="natural", count=16)
    [batch] = pipeline.evaluation(Split(tmp_path, "train").shard_paths(), size=SIZE, batch_size=16)
    assert np.median(batch["specular_albedo"]) < 0.1
    total = np.max(batch["diffuse_albedo"], axis=1) + batch["specular_albedo"]
    assert np.max(total) <= 1.000001


def test_the_command(bank, tmp_path, capsys):
    out = tmp_path / "out"
    assert cli.main(["scenes", str(bank), str(out), "--count", "16", "--shard-size", "8"]) == 0
    assert f"16 examples in {out / 'train'}" in capsys.readouterr().out
    description = json.loads(Split(out, "train").manifest_path.read_text())["description"]
    assert description["materials"] == "uniform" and description["size"] == SIZE
    assert cli.main(["scenes", str(tmp_path / "none"), str(out), "--count", "16"]) == 1
    assert "bank.json is missing" in capsys.readouterr().err
