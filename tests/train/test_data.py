"""Batches of corpora go on where they were, and are painted and cut out as the stage asks."""

import dataclasses
import itertools
import json

import numpy as np
import pytest
import stage_runs
from sphere_corpus import write_split

from lime_keras.data import clutter, prints
from lime_keras.data.features import LEARNT_FROM
from lime_keras.train import data as train_data
from lime_keras.train.config import corpus_sha256, lobe_of
from lime_keras.train.data import SEEN_MASK, Data
from lime_keras.train.stages import Stage

STAGE = Stage(("segmentation",), 4, 1e-3)


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    """Two corpora, of seeds 0 and 1."""
    folder = tmp_path_factory.mktemp("paths")
    write_split(folder / "corpus", "train", [range(4), range(4, 12)], size=32)
    write_split(folder / "other", "train", [range(4), range(4, 12)], seed=1, size=32)
    return folder


def _data(folder, *names):
    found = [folder / name for name in names]
    return Data(found, stage_runs.config(*found))


def _first(data, step, count):
    return list(itertools.islice(data.training(STAGE, ["image"], step), count))


def test_rows_are_equal_parts_of_the_batches(paths):
    found = [paths / "corpus", paths / "other"]
    config = stage_runs.config(*found)
    whole, *parts = (_first(Data(found, config, rows), 1, 4) for rows in [(0, 1), (0, 2), (1, 2)])
    for expected, one, other in zip(whole, *parts, strict=True):
        for name, value in expected.items():
            assert len(one[name]) == len(other[name]) == 2
            np.testing.assert_array_equal(value, np.concatenate([one[name], other[name]]))


@pytest.mark.parametrize("names", [["corpus"], ["corpus", "other"]])
def test_batches_go_on_from_any_step(paths, names):
    whole = _first(_data(paths, *names), 0, 7)
    for step in (1, 2, 4):
        resumed = _first(_data(paths, *names), step, 7 - step)
        for expected, batch in zip(whole[step:], resumed, strict=True):
            for name in expected:
                np.testing.assert_array_equal(batch[name], expected[name])


def test_held_out_batches_are_of_every_path_and_kept(paths, monkeypatch):
    data = _data(paths, "corpus", "other")
    batches = list(data.held_out(["mask", "seed"]))
    # Four examples make up a batch, of which each path gets one.
    assert [set(map(int, batch["seed"])) for batch in batches] == [{0}, {1}]
    monkeypatch.setattr(data._corpora, "held_out", None)
    again = list(data.held_out(["mask"]))
    assert [set(batch) for batch in again] == [{"mask"}] * 2
    assert all(one["mask"] is other["mask"] for one, other in zip(batches, again, strict=True))


def test_held_out_batches_are_made_anew_for_more_features(paths):
    data = _data(paths, "corpus")
    assert "environment" not in next(data.held_out(["mask"]))
    (batch,) = data.held_out(["environment", "shininess"])
    assert set(batch) == {"environment", "shininess"}


def test_who_is_to_blame(paths):
    data = _data(paths, "corpus")
    (batch,) = _first(data, 0, 1)
    index = int(batch["index"][3])
    expected = f"example {index} of seed 0 of the train split: render it again, or leave it out"
    assert data.blamed(batch, [3]) == expected


def test_data_of_another_unit_or_size_is_refused(paths, tmp_path):
    corpus = write_split(tmp_path / "literal", "train", [range(2), range(2)], size=32)
    path = corpus / "train" / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8"))
    manifest["description"]["shading"] = "literal"
    path.write_text(json.dumps(manifest), encoding="utf-8")
    with pytest.raises(ValueError, match="rendered with --shading literal, which is no"):
        Data([corpus, paths / "other"], stage_runs.config(corpus))
    small = write_split(tmp_path / "small", "train", [range(2), range(2)], size=48)
    with pytest.raises(ValueError, match="small holds images of 48 pixels"):
        Data([small], stage_runs.config(small))


def test_corpora_of_different_lobes_are_refused_by_name(tmp_path):
    corpora = [write_split(tmp_path / name, "train", [range(1), range(1)]) for name in "ab"]
    assert lobe_of(corpora) == "furnace"
    path = corpora[1] / "train" / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8"))
    manifest["description"]["shading"] = "printed"
    path.write_text(json.dumps(manifest), encoding="utf-8")
    assert lobe_of(corpora[1:]) == "printed"
    with pytest.raises(ValueError, match=r"a has --lobe furnace and .*b --lobe printed: their m_s"):
        lobe_of(corpora)


def test_a_bank_is_refused_with_what_took_its_place(tmp_path):
    (tmp_path / "bank" / "geometry").mkdir(parents=True)
    with pytest.raises(ValueError, match=r"is a bank.* `lime-render OUT --split train --endless"):
        corpus_sha256([tmp_path / "bank"])


def test_the_data_are_identified_by_their_files(paths):
    names = ("corpus", "other")
    digests = {corpus_sha256([paths / name]) for name in names}
    assert len(digests | {corpus_sha256([paths / name for name in names])}) == 3


def _own(path):
    """Return the config of a brief run that is not trained as in the paper."""
    plain = stage_runs.config(path)
    schedule = dataclasses.replace(plain.schedule, paints=True, found_masks=True)
    return dataclasses.replace(plain, schedule=schedule)


def test_every_process_of_a_run_damages_its_own_masks(paths, monkeypatch):
    monkeypatch.setattr(
        train_data.masks, "seen", lambda masker, images, true, draws: draws.random()
    )
    drawn = []
    for part in range(2):
        data = Data([paths / "corpus"], _own(paths / "corpus"), rows=(part, 2))
        batches = data.training(Stage(("albedo",), 4, 1e-3), [*LEARNT_FROM, SEEN_MASK], 0)
        drawn += [batch[SEEN_MASK] for batch in itertools.islice(batches, 3)]
    assert len(set(drawn)) == 6


@pytest.mark.parametrize("stage", ["segmentation", "specular"])
def test_clutter_is_of_masks_alone_and_prints_are_of_all_others(paths, stage, monkeypatch):
    monkeypatch.setattr(prints, "_PRINTED", 1.0)
    data, here = Data([paths / "corpus"], _own(paths / "corpus")), Stage((stage,), 4, 1e-3)

    def batches():
        return list(itertools.islice(data.training(here, LEARNT_FROM, 0), 4))

    with monkeypatch.context() as without:
        without.setattr(clutter, "add", lambda images, masks, generator: images)
        without.setattr(prints, "add", lambda batch, generator: batch["image"])
        plain = batches()
    seen = batches()
    changed, around = [], []
    for one, other in zip(plain, seen, strict=True):
        differs = np.asarray(one["image"]) != np.asarray(other["image"])
        changed.append(differs.any())
        around.append((differs & (np.asarray(one["mask"]) == 0)).mean())
    assert any(changed)
    assert (max(around) > 0.01) == (stage == "segmentation")
    later = next(data.training(here, LEARNT_FROM, 3))
    assert np.array_equal(np.asarray(later["image"]), np.asarray(seen[3]["image"]))


def test_cut_outs_are_of_masks_alone(paths, monkeypatch):
    class Painted:
        def __init__(self, things, places, size):
            assert (things, places, size) == ("things", "places", 32)

        def put(self, images, masks, generator):
            return np.zeros_like(images), np.ones_like(masks)

    monkeypatch.setattr(train_data, "Cutouts", Painted)
    config = dataclasses.replace(stage_runs.config(paths / "corpus"), cutouts="some hash")
    with pytest.raises(FileNotFoundError, match="pass its --cutouts again"):
        Data([paths / "corpus"], config)
    data = Data([paths / "corpus"], config, photographs=("things", "places"))
    features = ["image", "mask"]
    seen = next(data.training(STAGE, features, 0))
    assert not seen["image"].any() and (seen["mask"] == 1).all()
    seen = next(data.training(Stage(("specular",), 4, 1e-3), LEARNT_FROM, 0))
    assert np.asarray(seen["image"]).any() and not (np.asarray(seen["mask"]) == 1).all()
    for held_out in data.held_out(features):
        assert np.asarray(held_out["image"]).any()


class Masker:
    """In place of a trained SegmentationNet: its masks are of one level."""

    layers = ()

    def __init__(self, level):
        self.level = level

    def predict_on_batch(self, images):
        return np.full((*images.shape[:3], 1), self.level, np.float32)


MATERIAL = Stage(("albedo",), 4, 1e-3)


def _seen(data, step=0, count=3):
    """Return masks as they are seen, and true ones, of some training batches."""
    batches = data.training(MATERIAL, ["image", "mask", SEEN_MASK], step)
    return [
        (batch[SEEN_MASK], np.asarray(batch["mask"])) for batch in itertools.islice(batches, count)
    ]


@pytest.mark.parametrize("papers", [False, True])
def test_all_stages_but_segmentation_see_masks_that_are_not_true(paths, papers):
    config = stage_runs.config(paths / "corpus") if papers else _own(paths / "corpus")
    data = Data([paths / "corpus"], config)
    assert data.seen(STAGE, ["image"]) == ("image",)
    for names in (("albedo",), ("specular", "mirror")):
        expected = ("image",) if papers else ("image", SEEN_MASK)
        assert data.seen(Stage(names, 4, 1e-3), ["image"]) == expected


def test_batches_are_cut_out_by_what_is_seen(paths):
    data = _data(paths, "corpus")
    for seen, true in _seen(data):
        changed = (seen != true).any(axis=(1, 2, 3))
        assert changed.tolist() == [True, False, False, False]
    data.cut_out_by(Masker(0.5))
    batches = _seen(data)
    for seen, true in batches:
        assert seen.dtype == np.float32
        np.testing.assert_array_equal(seen[:2], 0.5)
        assert (seen[2] != true[2]).any() and (seen[2] != 0.5).any()
        np.testing.assert_array_equal(seen[3], true[3])
    # They go on from any step, and each step has its own damage.
    ((later, _),) = _seen(data, 2, 1)
    np.testing.assert_array_equal(later, batches[2][0])
    assert (batches[0][0][2] != batches[1][0][2]).any()


def test_held_out_batches_are_cut_out_by_the_network_alone(paths):
    data = _data(paths, "corpus", "other")
    wanted = ["mask", "image", SEEN_MASK]

    def seen():
        return [(batch[SEEN_MASK], np.asarray(batch["mask"])) for batch in data.held_out(wanted)]

    for found, true in seen():
        np.testing.assert_array_equal(found, true)
    # What another network had found is forgotten, what was read is kept.
    for level in (0.5, 0.6):
        data.cut_out_by(Masker(level))
        for found, true in seen():
            np.testing.assert_allclose(found, 1.5 * (level - 0.5) + 0.5, atol=1e-6)
            assert found.shape == true.shape
    assert all(SEEN_MASK not in batch for batch in data.held_out(["mask"]))
