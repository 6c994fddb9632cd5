"""The masks that a material is learnt on: as SegmentationNet finds them, damaged, and true."""

import dataclasses

import numpy as np
import pytest

from lime_keras.networks import assemble, build
from lime_keras.train.sources import masks


def _disc(size, share=0.3):
    place = (np.arange(size) + 0.5) / size - 0.5
    distance = np.hypot(place, place[:, None]) * size
    return np.clip(share * size - distance + 0.5, 0, 1)[..., None].astype(np.float32)


def _batch(count, size=32, seed=0):
    images = np.random.default_rng(seed).uniform(size=(count, size, size, 3)).astype(np.float32)
    return images, np.stack([_disc(size, 0.2 + 0.02 * index) for index in range(count)])


class Grey:
    """In place of SegmentationNet: one answer for all pixels, and what it was asked."""

    layers = ()

    def __init__(self, level=0.4):
        self._level, self.asked = level, []

    def predict_on_batch(self, images):
        self.asked.append(images)
        return np.full((*images.shape[:3], 1), self._level, np.float32)


def test_own_masks_are_those_that_the_whole_system_cuts_out_with(tiny):
    network = build(dataclasses.replace(tiny, unet_width=8), seed=3)["segmentation"]
    images, _ = _batch(3)
    # Fresh answers are around 0, where masks are clipped: here they are around one half.
    raw, head = network.predict_on_batch(images), network.get_layer("head")
    head.kernel.assign(head.get_weights()[0] / raw.std())
    head.bias.assign([0.5 - raw.mean() / raw.std()])
    found = masks.own(network, images)
    whole = assemble({"segmentation": network}, ["mask"])(images)["mask"]
    np.testing.assert_allclose(found, whole, atol=1e-5)
    # Raised in contrast and clipped: neither raw nor constant.
    assert np.abs(found - network.predict_on_batch(images)).max() > 0.05
    assert np.ptp(found) > 0.5


@pytest.mark.parametrize(
    "count, own, damaged", [(1, 0, 0), (2, 1, 0), (4, 2, 1), (8, 4, 2), (16, 8, 4)]
)
def test_shares_of_own_damaged_and_true_masks(count, own, damaged):
    images, true = _batch(count)
    network = Grey()
    seen = masks.seen(network, images, true, np.random.default_rng(5))
    assert seen.shape == true.shape and seen.dtype == np.float32
    np.testing.assert_allclose(seen[:own], 1.5 * (0.4 - 0.5) + 0.5, atol=1e-6)
    for index in range(own, own + damaged):
        assert (seen[index] != true[index]).any() and np.ptp(seen[index]) > 0.5
    np.testing.assert_array_equal(seen[own + damaged :], true[own + damaged :])
    assert [len(asked) for asked in network.asked] == ([own] if own else [])
    np.testing.assert_array_equal(true, _batch(count)[1])


def test_without_a_network_masks_are_damaged_or_true():
    images, true = _batch(8)
    seen = masks.seen(None, images, true, np.random.default_rng(5))
    changed = (seen != true).any(axis=(1, 2, 3))
    assert changed.tolist() == [True] * 2 + [False] * 6


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


def test_damage_follows_from_the_seed_alone():
    images, true = _batch(8)

    def seen(seed):
        return masks.seen(Grey(), images, true, np.random.default_rng(seed))

    np.testing.assert_array_equal(seen(7), seen(7))
    assert (seen(7)[4:6] != seen(8)[4:6]).any(axis=(1, 2, 3)).all()
