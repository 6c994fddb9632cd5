"""The masks that a material is learnt on: as SegmentationNet finds them, damaged, and true."""

import dataclasses

import numpy as np
import pytest

from lime_keras.networks import assemble, build
from lime_keras.train.photos import answers, masks


def _disc(size, share=0.3):
    place = (np.arange(size) + 0.5) / size - 0.5
    distance = np.hypot(place, place[:, None]) * size
    return np.clip(share * size - distance + 0.5, 0, 1)[..., None].astype(np.float32)


def test_own_masks_are_those_that_the_whole_system_cuts_out_with(tiny):
    network = build(dataclasses.replace(tiny, unet_width=8), seed=3)["segmentation"]
    images = np.random.default_rng(0).uniform(size=(3, 32, 32, 3)).astype(np.float32)
    # Fresh answers are around 0, where masks are clipped: here they are around one half.
    raw, head = network.predict_on_batch(images), network.get_layer("head")
    head.kernel.assign(head.get_weights()[0] / raw.std())
    head.bias.assign([0.5 - raw.mean() / raw.std()])
    found = answers.predict_mask(network, images)
    whole = assemble({"segmentation": network}, ["mask"])(images)["mask"]
    np.testing.assert_allclose(found, whole, atol=1e-5)
    # Raised in contrast and clipped: neither raw nor constant.
    assert np.abs(found - network.predict_on_batch(images)).max() > 0.05
    assert np.ptp(found) > 0.5


def test_shares_of_predicted_damaged_and_true_masks():
    true, counts = _disc(32), [0, 0, 0]
    for seed in range(400):
        found = masks.input_mask(true, np.random.default_rng(seed))
        assert found is None or (found.shape == true.shape and found.dtype == np.float32)
        counts[0 if found is true else 1 if found is None else 2] += 1
    np.testing.assert_allclose(counts, (100, 200, 100), atol=40)
    np.testing.assert_array_equal(true, _disc(32))


@pytest.mark.parametrize("size", [32, 128])
def test_damage_moves_edges_both_ways_and_nothing_else(size, monkeypatch):
    monkeypatch.setattr(masks, "_BITTEN", 0.0)
    true = _disc(size)
    # As far as the blur reaches from the edge, and the edge's own pixel.
    reach = (round(4 * size / 128) + 1) / size
    within, beyond = _disc(size, 0.3 - 2 * reach) == 1, _disc(size, 0.3 + 2 * reach) == 0
    areas = []
    for seed in range(12):
        found = masks.damaged(true, np.random.default_rng(seed))
        assert (found[within] == 1).all() and (found[beyond] == 0).all()
        areas.append(found.sum() / true.sum())
        assert np.abs(found - true).max() > 0.2
    assert min(areas) < 0.99 and max(areas) > 1.01


def test_some_damaged_masks_lack_a_piece_and_some_let_one_in(monkeypatch):
    true = _disc(64)
    within, beyond = _disc(64, 0.24) == 1, _disc(64, 0.36) == 0
    for share, expected in ((0.0, False), (1.0, True)):
        monkeypatch.setattr(masks, "_BITTEN", share)
        found = [masks.damaged(true, np.random.default_rng(seed)) for seed in range(8)]
        assert any((one[within] < 0.5).any() for one in found) == expected
        assert any((one[beyond] > 0.5).any() for one in found) == expected


@pytest.mark.parametrize("size", [32, 64, 128])
@pytest.mark.parametrize("bitten", [0.0, 1.0])
def test_empty_and_full_masks_are_damaged_too(size, bitten, monkeypatch):
    monkeypatch.setattr(masks, "_BITTEN", bitten)
    for seed in range(4):
        for level in (0.0, 0.5, 1.0):
            flat = np.full((size, size, 1), level, np.float32)
            found = masks.damaged(flat, np.random.default_rng(seed))
            assert found.dtype == np.float32 and found.shape == flat.shape
            assert np.isfinite(found).all() and 0 <= found.min() and found.max() <= 1
            if level == 0:
                assert not found.any()
            if level == 1:
                assert found.max() == 1


def test_damage_follows_from_the_generator_alone():
    one, other, third = (masks.damaged(_disc(32), np.random.default_rng(n)) for n in (7, 7, 8))
    assert np.array_equal(one, other) and not np.array_equal(one, third)
