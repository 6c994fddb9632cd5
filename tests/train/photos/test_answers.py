"""What frozen subnetworks predict, kept: a stage learns from it as if it were predicted anew."""

import dataclasses

import keras
import numpy as np
import pytest
import stage_runs

from lime_keras.networks import build
from lime_keras.networks.registry import QUANTITIES, is_plain
from lime_keras.networks.wiring import Wiring
from lime_keras.train.photos import answers, masks
from lime_keras.train.photos.kept import INPUT_MASK, PREDICTED, Kept
from lime_keras.train.stage_model import StageModel

SIZE, COUNT = stage_runs.TINY.size, 5


@pytest.fixture(scope="module")
def networks():
    return build(stage_runs.TINY, seed=2)


@pytest.fixture
def photos(tmp_path):
    batch = stage_runs.noise(np.random.default_rng(0), COUNT)
    kept = Kept(tmp_path / "photos", COUNT, tuple(batch), SIZE)
    kept.begin()
    kept.write(0, batch)
    kept.finish({})
    return kept


def _of(networks, *names):
    return {name: networks[name] for name in names}


def test_only_what_reads_no_learning_subnetwork_is_kept(networks):
    stage = _of(networks, "specular", "mirror", "exponent", "albedo")
    kept = answers.independent(stage, ("specular", "mirror"))
    assert list(kept) == ["specular", "mirror"]
    # M follows from S, which learns; numbers of the material are no layers.
    assert not answers.independent(stage, ("mirror",))
    assert list(answers.independent(stage, ("specular", "albedo"))) == ["specular"]
    linear = build(dataclasses.replace(stage_runs.TINY, linear=True))
    assert not answers.independent(_of(linear, "specular", "mirror"), ("mirror",))


def test_only_what_is_read_is_kept(networks):
    frozen = _of(networks, "specular", "mirror")
    # The paper's ExponentNet reads M, which follows from S; its AlbedoNet reads S alone.
    assert list(answers.read_by(_of(networks, "exponent"), frozen)) == ["specular", "mirror"]
    assert list(answers.read_by(_of(networks, "albedo"), frozen)) == ["specular"]
    assert not answers.read_by(_of(networks, "segmentation"), frozen)


def test_a_stage_learns_from_kept_predictions_as_from_fresh_ones(networks, photos, tmp_path):
    names = ("specular", "mirror", "exponent")
    frozen = answers.independent(_of(networks, *names), ("specular", "mirror"))
    told = Kept(tmp_path / "answers", COUNT, answers.features(frozen), SIZE)
    answers.make(photos, told, frozen, 1, lambda *progress: None)
    rows = np.arange(COUNT)
    batch = photos.read(rows, photos.features) | told.read(rows, told.features)
    fresh = StageModel(_of(networks, *names), losses="robust")
    kept = StageModel(_of(networks, "exponent"), losses="robust", kept=frozen)
    assert f"{PREDICTED}mirror" in kept.features
    found = [model(batch).raw["exponent_bin_probabilities"] for model in (fresh, kept)]
    expected, seen = map(keras.ops.convert_to_numpy, found)
    assert np.ptp(expected) > 1e-3
    np.testing.assert_allclose(seen, expected, rtol=0.02, atol=2e-3)


@pytest.mark.parametrize("parts", [{"linear": True}, {"dichromatic": True, "hue": True}])
def test_kept_predictions_are_those_of_the_wiring(photos, tmp_path, parts):
    """With plain heads, and with a split of colours that SpecularNet reads."""
    frozen = _of(build(dataclasses.replace(stage_runs.TINY, **parts)), "specular", "mirror")
    told = Kept(tmp_path / "answers", COUNT, answers.features(frozen), SIZE)
    answers.make(photos, told, frozen, 1, lambda *progress: None)
    rows = np.arange(COUNT)
    kept = told.read(rows, told.features)
    seen = photos.read(rows, ("image",)) | {"mask": kept[INPUT_MASK]}
    wiring = Wiring(frozen, seen, training=False)
    for quantity, name in (("specular_shading", "specular"), ("mirror", "mirror")):
        raw = wiring.raw_prediction(quantity)
        raw = QUANTITIES[quantity].plain(raw) if is_plain(frozen[name]) else raw
        expected = keras.ops.convert_to_numpy(raw)
        found = kept[f"{PREDICTED}{quantity}"]
        assert np.abs(found - expected).max() <= 0.02 * np.abs(expected).max() + 1e-6, quantity


def test_predictions_are_those_for_the_mask_that_the_files_hold(networks, photos, tmp_path):
    """Which is rounded, so it does not matter whether a mask was just drawn, or read."""
    frozen, rows = _of(networks, "specular"), np.arange(COUNT)
    made, again = (
        Kept(tmp_path / name, COUNT, answers.features(frozen), SIZE) for name in ("made", "again")
    )
    answers.make(photos, made, frozen, 1, lambda *progress: None)
    mask = made.read(rows, (INPUT_MASK,))[INPUT_MASK]
    batch = photos.read(rows, ("image",)) | {"mask": mask}
    again.begin()
    again.write(0, {INPUT_MASK: mask, **answers._layers(batch, answers._joined(frozen))})
    again.finish({})
    for name, value in made.read(rows, made.features).items():
        np.testing.assert_array_equal(again.read(rows, (name,))[name], value, err_msg=name)


def test_segmentation_looks_only_at_photos_whose_mask_it_finds(networks, photos, tmp_path):
    looked = []

    def found(network, images):
        looked.append(images)
        return np.mean(images, axis=-1, keepdims=True)

    told = Kept(tmp_path / "masks", COUNT, answers.features({}), SIZE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(answers, "predict_mask", found)
        answers.make(photos, told, _of(networks, "segmentation"), 1, lambda *progress: None)
    rows = np.arange(COUNT)
    seen = told.read(rows, told.features)[INPUT_MASK]
    batch = photos.read(rows, ("image", "mask"))
    drawn = [
        masks.input_mask(true, np.random.default_rng((1, row)))
        for row, true in enumerate(batch["mask"])
    ]
    found_here = [row for row in rows if drawn[row] is None]
    assert 0 < len(found_here) < COUNT
    assert {one.tobytes() for one in looked[0]} == {
        batch["image"][row].tobytes() for row in found_here
    }
    for row in rows:
        expected = batch["image"][row].mean(-1, keepdims=True) if drawn[row] is None else drawn[row]
        np.testing.assert_allclose(seen[row], expected, atol=0.51 / 255)


def test_of_several_devices_the_first_answers(networks, monkeypatch):
    """Under TensorFlow each of them answers all photos, one device behind the other."""
    masker, images = networks["segmentation"], np.random.default_rng(3).random((3, SIZE, SIZE, 3))
    expected, alone = answers.predict_mask(masker, images), masker.predict_on_batch
    monkeypatch.setattr(masker, "predict_on_batch", lambda some: np.tile(alone(some), (2, 1, 1, 1)))
    np.testing.assert_array_equal(answers.predict_mask(masker, images), expected)


def test_answers_follow_from_photos_and_weights(networks, photos, tmp_path):
    segmentation = _of(networks, "segmentation")
    found = []
    for folder in ("one", "two"):
        told = Kept(tmp_path / folder, COUNT, answers.features({}), SIZE)
        answers.make(photos, told, segmentation, 1, lambda *progress: None)
        found.append(told.read(np.arange(COUNT), told.features)[INPUT_MASK])
    np.testing.assert_array_equal(*found)
    before = answers.sha256(segmentation)
    networks["segmentation"].get_layer("head").bias.assign_add([0.1])
    assert answers.sha256(segmentation) != before
