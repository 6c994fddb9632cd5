"""Batches of kept photos: in an order that goes on, flipped, cut out, and shared by the stages."""

import dataclasses
import itertools
import json

import json_files
import numpy as np
import pytest
import stage_runs
from sphere_corpus import write_split

from lime_keras.data.corpus import Split
from lime_keras.networks import build
from lime_keras.train.config import corpus_sha256, lobe_of
from lime_keras.train.data import Data
from lime_keras.train.photos.kept import INPUT_MASK
from lime_keras.train.stages import Stage

MASKS, MATERIAL = Stage(("segmentation",), 4, 1e-3), Stage(("albedo",), 4, 1e-3)
OWN = {"camera": True, "flips": True, "repaints": True, "paints": True, "found_masks": True}


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    """Two corpora, of seeds 0 and 1."""
    folder = tmp_path_factory.mktemp("paths")
    write_split(folder / "corpus", "train", [range(4), range(4, 12)], size=32)
    write_split(folder / "other", "train", [range(4), range(4, 12)], seed=1, size=32)
    return folder


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """One folder for the photos of all tests: what another test has made is read."""
    return tmp_path_factory.mktemp("run")


def _config(*paths, photos=6, **switches):
    plain = stage_runs.config(*paths)
    schedule = dataclasses.replace(plain.schedule, **(switches or OWN))
    return dataclasses.replace(plain, schedule=schedule, photos=photos)


def _data(paths, run, *names, **options):
    found = [paths / name for name in names or ["corpus"]]
    return Data(found, _config(*found, **options), run)


def _first(data, step, count, stage=MATERIAL, features=("image", "mask", "ambient")):
    return list(itertools.islice(data.training(stage, features, step), count))


def test_the_batches_of_a_stage_are_the_same_beside_longer_stages(paths, tmp_path):
    def batches(architecture, folder):
        own = _config(paths / "corpus", photos=100)
        own = dataclasses.replace(own, architecture=architecture)
        longest = max(stage.steps for stage in own.schedule.stages(architecture))
        data = Data([paths / "corpus"], own, tmp_path / folder)
        return longest, _first(data, 0, 4, dataclasses.replace(MATERIAL, steps=1))

    whole = _config(paths / "corpus").architecture
    (long, first), (short, second) = (
        batches(dataclasses.replace(whole, mirror=mirror), str(mirror)) for mirror in (True, False)
    )
    assert long != short
    for expected, batch in zip(first, second, strict=True):
        for name in expected:
            np.testing.assert_array_equal(batch[name], expected[name])


def test_batches_go_on_from_any_step(paths, run):
    """Six photos, four in a batch: a batch may span two epochs."""
    whole = _first(_data(paths, run), 0, 7)
    for step in (1, 2, 4):
        resumed = _first(_data(paths, run), step, 7 - step)
        for expected, batch in zip(whole[step:], resumed, strict=True):
            for name in expected:
                np.testing.assert_array_equal(batch[name], expected[name])


def test_each_photo_is_seen_once_an_epoch_in_another_order_and_either_way(paths, run):
    batches = _first(_data(paths, run), 0, 12)
    images = np.concatenate([batch["image"] for batch in batches])
    names = [min(one.tobytes(), one[:, ::-1].tobytes()) for one in images]
    epochs = [names[first : first + 6] for first in range(0, 48, 6)]
    assert all(len(set(epoch)) == 6 for epoch in epochs) and len(set(names)) == 6
    assert len(set(map(tuple, epochs))) > 3
    assert len({one.tobytes() for one in images}) > 9


def test_photos_are_made_before_a_batch_is_asked_for_and_hold_what_is_learnt_from(paths, tmp_path):
    data = _data(paths, tmp_path)
    data.training(MATERIAL, ("image",), 0)
    (kept,) = data._opened.values()
    assert kept.is_complete
    # The paper's Eq. 5 knows no clipping, and only MirrorNet learns from M.
    assert {"image", "mask", "mirror", "painted"} < set(kept.features)
    assert not {"clipped", "cast", "environment"} & set(kept.features)
    config = _config(paths / "corpus")
    bare = dataclasses.replace(
        config,
        architecture=dataclasses.replace(config.architecture, mirror=False),
        schedule=dataclasses.replace(config.schedule, losses="robust"),
    )
    found = set(Data([paths / "corpus"], bare, tmp_path).features)
    assert "mirror" not in found and {"clipped", "cast"} < found


def test_without_flips_there_are_none(paths, run):
    batches = _first(_data(paths, run, flips=False, camera=False), 0, 8)
    images = {one.tobytes() for batch in batches for one in batch["image"]}
    # Four scenes are trained on, of which there is one picture each.
    assert len(images) == 4


def test_stages_share_photos_in_orders_of_their_own(paths, run):
    data = _data(paths, run)
    one, other = (_first(data, 0, 3, Stage((name,), 4, 1e-3)) for name in ("albedo", "specular"))
    named = [
        {
            (int(s), int(i))
            for batch in batches
            for s, i in zip(batch["seed"], batch["index"], strict=True)
        }
        for batches in (one, other)
    ]
    assert named[0] == named[1]
    assert not np.array_equal(one[0]["image"], other[0]["image"])
    assert len(data._opened) == 1


def test_clutter_is_of_masks_alone(paths, run):
    data = _data(paths, run)
    _first(data, 0, 1, MASKS, ("image", "mask")), _first(data, 0, 1)
    recipes = []
    for kept in data._opened.values():
        record = json.loads((kept.folder / "photos.json").read_text(encoding="utf-8"))
        recipes.append((record["recipe"]["paint"], "diffuse_shading" in record["features"]))
    assert sorted(recipes) == [("clutter", False), ("prints", True)]
    bare = _data(paths, run, **OWN | {"paints": False})
    _first(bare, 0, 1, MASKS, ("image", "mask")), _first(bare, 0, 1)
    assert len(bare._opened) == 1


def test_validation_photos_are_of_every_path_without_paint(paths, run):
    data = _data(paths, run, "corpus", "other")
    batches = list(data.validation([*data.features, "seed", "index"]))
    found = [pair for one in batches for pair in zip(one["seed"], one["index"], strict=True)]
    # Four examples in all: two that each corpus holds out.
    assert sorted((int(s), int(i)) for s, i in found) == [(0, 4), (0, 5), (1, 4), (1, 5)]
    assert not any(one["painted"].any() for one in batches)
    again = list(_data(paths, run, "corpus", "other").validation(["image"]))
    np.testing.assert_array_equal(again[0]["image"], batches[0]["image"])


def test_data_of_another_size_are_refused(tmp_path):
    small = write_split(tmp_path / "small", "train", [range(2), range(2)], size=48)
    with pytest.raises(ValueError, match=r"48 pixels.* --size that divides 48"):
        Data([small], stage_runs.config(small), tmp_path)


def test_corpora_of_different_lobes_are_refused_by_name(tmp_path):
    corpora = [write_split(tmp_path / name, "train", [range(1), range(1)]) for name in "ab"]
    assert lobe_of(corpora) == "furnace"
    with json_files.edited(corpora[1] / "train" / "manifest.json") as manifest:
        manifest["description"]["shading"] = "printed"
    assert lobe_of(corpora[1:]) == "printed"
    with pytest.raises(ValueError, match=r"a has --lobe furnace and .*b --lobe printed: their m_s"):
        lobe_of(corpora)


@pytest.mark.parametrize("law", [{}, {"light_law": "mixed"}, {"endless": 0.5}])
def test_scenes_are_plain_without_mixed_lights_and_endless_bodies(tmp_path, law):
    corpus = write_split(tmp_path / "corpus", "train", [range(1), range(1)])
    with json_files.edited(corpus / "train" / "manifest.json") as manifest:
        manifest["description"] |= law
    assert Split(corpus, "train").is_plain == (not law)


def test_the_data_are_identified_by_their_files(paths):
    names = ("corpus", "other")
    digests = {corpus_sha256([paths / name]) for name in names}
    assert len(digests | {corpus_sha256([paths / name for name in names])}) == 3


def test_cut_outs_are_of_masks_alone_and_needed_again(paths, tmp_path):
    config = dataclasses.replace(_config(paths / "corpus"), cutouts="some hash")
    with pytest.raises(FileNotFoundError, match="pass its --cutouts again"):
        Data([paths / "corpus"], config, tmp_path)
    nothing = (tmp_path / "things", tmp_path / "places")
    data = Data([paths / "corpus"], config, tmp_path / "run", photographs=nothing)
    assert _first(data, 0, 1)
    with pytest.raises(FileNotFoundError, match="things holds no PNG or WebP pictures"):
        _first(data, 0, 1, MASKS, ("image", "mask"))


class Masker:
    """In place of a trained SegmentationNet: its masks are of one level."""

    layers = ()

    def __init__(self, level):
        self.level = level

    def get_weights(self):
        return [np.float32(self.level)]

    def predict_on_batch(self, images):
        return np.full((*images.shape[:3], 1), self.level, np.float32)


@pytest.mark.parametrize("found_masks", [False, True])
def test_all_stages_but_segmentation_see_masks_that_are_not_true(paths, run, found_masks):
    data = _data(paths, run, **OWN | {"found_masks": found_masks})
    assert data.with_input_mask(MASKS, ["image"]) == ("image",)
    for names in (("albedo",), ("specular", "mirror")):
        expected = ("image", INPUT_MASK) if found_masks else ("image",)
        assert data.with_input_mask(Stage(names, 4, 1e-3), ["image"]) == expected


def test_photos_are_cut_out_by_what_is_found(paths, run):
    def kinds(level):
        """Return whether each photo's mask is true, of the level, or neither, in the order seen."""
        data = _data(paths, run, photos=40)
        data.set_masker(None if level is None else Masker(level))
        out = []
        for batch in _first(data, 0, 10, features=("image", "mask", INPUT_MASK)):
            assert batch[INPUT_MASK].dtype == np.float32
            for seen, true in zip(batch[INPUT_MASK], batch["mask"], strict=True):
                own = level is not None and np.allclose(seen, 1.5 * (level - 0.5) + 0.5, atol=3e-3)
                out.append("true" if np.array_equal(seen, true) else "own" if own else "damaged")
        return out

    names = ("true", "own", "damaged")
    shares = [[found.count(kind) for kind in names] for found in map(kinds, (None, 0.4))]
    assert shares[0][1] == 0 and 2 <= shares[0][2] <= 20
    assert 2 <= shares[1][0] <= 20 and 10 <= shares[1][1] <= 30
    assert kinds(0.4) == kinds(0.4) and kinds(0.4).count("damaged") == shares[0][2]


@pytest.mark.parametrize("found_masks", [False, True])
def test_frozen_subnetworks_see_the_masks_of_those_that_learn(paths, tmp_path, found_masks):
    data = _data(paths, tmp_path, **OWN | {"found_masks": found_masks}, photos=40)
    data.set_masker(Masker(0.4))
    photos, features = data._photos(MATERIAL), data.with_input_mask(MATERIAL, ["image"])
    frozen = {"specular": build(stage_runs.TINY)["specular"]}
    for seed in (1, None):
        kept = data._answers(photos, features, frozen, seed)
        rows = np.arange(photos.count)
        seen, true = kept.read(rows, (INPUT_MASK,)), photos.read(rows, ("mask",))
        assert np.array_equal(seen[INPUT_MASK], true["mask"]) != found_masks


def test_validation_photos_are_cut_out_by_the_network_alone(paths, run):
    data = _data(paths, run, "corpus", "other")

    def seen():
        batches = data.validation(["mask", "image", INPUT_MASK])
        return [(batch[INPUT_MASK], batch["mask"]) for batch in batches]

    for found, true in seen():
        np.testing.assert_array_equal(found, true)
    for level in (0.5, 0.6):
        data.set_masker(Masker(level))
        for found, true in seen():
            np.testing.assert_allclose(found, 1.5 * (level - 0.5) + 0.5, atol=3e-3)
            assert found.shape == true.shape
    assert all(INPUT_MASK not in batch for batch in data.validation(["mask"]))
