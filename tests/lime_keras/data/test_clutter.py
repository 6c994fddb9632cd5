"""Clutter on and behind objects, with the mask still true."""

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


def only(monkeypatch, *names):
    """Switch off all kinds of clutter but these, which are sure."""
    for name in KINDS:
        monkeypatch.setattr(clutter, name, float(name in names))


KINDS = ("_TEXTURED", "_PARTED", "_PRINTED", "_CAMOUFLAGED", "_STUDIO", "_SHADED")


@pytest.mark.parametrize("kind", ["_TEXTURED", "_PARTED", "_PRINTED"])
def test_only_objects_are_painted(kind, monkeypatch):
    only(monkeypatch, kind)
    images, masks = _scenes()
    changed = 0
    for seed in range(4):
        out = clutter.add(images, masks, np.random.default_rng(seed))
        assert out.dtype == np.float32 and 0 <= out.min() and out.max() <= 1
        background = (masks == 0) & np.ones_like(images, bool)
        np.testing.assert_array_equal(out[background], images[background])
        changed += (np.abs(out - images) > 0.05).any(axis=(1, 2, 3)).sum()
    assert changed > 30


@pytest.mark.parametrize("kind", ["_CAMOUFLAGED", "_STUDIO"])
def test_only_backgrounds_are_exchanged(kind, monkeypatch):
    only(monkeypatch, kind)
    images, masks = _scenes(edge=1.0)
    images[:, ::2] *= np.float32([1.0, 0.9, 0.7])
    out = clutter.add(images, masks, np.random.default_rng(0))
    inside = (masks == 1) & np.ones_like(images, bool)
    np.testing.assert_allclose(out[inside], images[inside], atol=1e-6)
    assert (np.abs(out - images)[~inside] > 0.05).mean() > 0.3
    if kind == "_CAMOUFLAGED":
        behind, own = out[0][masks[0, ..., 0] == 0], images[0][masks[0, ..., 0] == 1].mean(0)
        cosine = behind.mean(0) @ own / np.linalg.norm(behind.mean(0)) / np.linalg.norm(own)
        assert cosine > 0.999


def test_shadows_darken(monkeypatch):
    only(monkeypatch, "_SHADED")
    images, masks = _scenes()
    out = clutter.add(images, masks, np.random.default_rng(2))
    assert (out <= images + 1e-6).all() and (out < 0.8 * images).any()
    assert (out >= 0.24 * images).all()


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_empty_and_full_masks(level):
    images = np.full((3, 8, 8, 3), 0.5, np.float32)
    masks = np.full((3, 8, 8, 1), level, np.float32)
    for seed in range(6):
        out = clutter.add(images, masks, np.random.default_rng(seed))
        assert np.isfinite(out).all()
        assert 0 <= out.min() and out.max() <= 1


def test_a_generator_determines_the_clutter():
    images, masks = _scenes()
    one, other, third = (
        clutter.add(images, masks, np.random.default_rng(seed)) for seed in (5, 5, 6)
    )
    assert np.array_equal(one, other) and not np.array_equal(one, third)
