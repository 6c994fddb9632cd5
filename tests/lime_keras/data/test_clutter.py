"""Clutter: prints on objects and other objects behind them, with the mask still true."""

import numpy as np
import pytest

from lime_keras.data import clutter


def _scenes(size=16, count=12, edge=0.5):
    """Return grey images whose objects are squares of different places and brightness."""
    images = np.full((count, size, size, 3), 0.2, np.float32)
    masks = np.zeros((count, size, size, 1), np.float32)
    for index in range(count):
        top = index % 6
        masks[index, top : top + 8, 3:11] = 1
        masks[index, top, 3:11] = edge
        images[index] += masks[index] * (0.4 + 0.02 * index)
    return images, masks


def test_only_objects_bear_prints():
    images, masks = _scenes()
    brighter = darker = 0
    for seed in range(8):
        out, pasted = clutter.add(images, masks, np.random.default_rng(seed))
        assert out.dtype == np.float32 and 0 <= out.min() and out.max() <= 1
        alone = ~pasted
        background = (masks == 0) & np.ones_like(images, bool)
        assert np.array_equal(out[alone][background[alone]], images[alone][background[alone]])
        change = (out - images)[alone]
        brighter += int((change > 0.05).any(axis=(1, 2, 3)).sum())
        darker += int((change < -0.05).any(axis=(1, 2, 3)).sum())
    assert brighter > 10 and darker > 10


def test_other_objects_stand_behind(monkeypatch):
    images, masks = _scenes(edge=1.0)
    monkeypatch.setattr(clutter, "_PRINTED", 0.0)
    out, pasted = clutter.add(images, masks, np.random.default_rng(1))
    assert 0 < pasted.sum() < len(images)
    whole = np.broadcast_to(masks == 1, images.shape)
    assert np.array_equal(out[whole], images[whole])
    for index in np.flatnonzero(pasted):
        changed = np.abs(out[index] - images[index]).max(axis=-1) > 1e-6
        assert 0 < changed.sum() <= 0.5 * masks[index].sum()
        # Where nothing of the scene's object is, the other one shows as it is.
        free = changed & (masks[index, ..., 0] == 0)
        held = np.unique(np.round(images[(index + 1) % len(images)], 4))
        assert np.isin(np.round(out[index][free], 4), held).all()


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_empty_and_full_masks(level):
    images = np.full((3, 8, 8, 3), 0.5, np.float32)
    masks = np.full((3, 8, 8, 1), level, np.float32)
    for seed in range(6):
        out, pasted = clutter.add(images, masks, np.random.default_rng(seed))
        assert not pasted.any() and np.isfinite(out).all() and out.max() <= 1
        if level == 0:
            assert np.array_equal(out, images)


def test_a_generator_determines_the_clutter():
    images, masks = _scenes()
    one, other, third = (
        clutter.add(images, masks, np.random.default_rng(seed))[0] for seed in (5, 5, 6)
    )
    assert np.array_equal(one, other) and not np.array_equal(one, third)
