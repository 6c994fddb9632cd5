"""Prints on objects, by Eq. 4, under highlights that stay."""

import numpy as np
import pytest

from lime_keras.data import prints
from lime_keras.optics import camera_law, colour


def _batch(count=6, size=32, cast=None):
    """Return scenes of Eq. 4 without noise; the objects are squares with a highlight."""
    rng = np.random.default_rng(5)
    mask = np.zeros((count, size, size, 1), np.float32)
    mask[:, 4:-4, 4:-4] = 1
    light = np.broadcast_to(np.linspace(0.2, 0.6, size, dtype=np.float32)[:, None], mask.shape[1:3])
    diffuse = np.broadcast_to(light[None, ..., None], mask.shape).astype(np.float32)
    albedo = rng.uniform(0.1, 0.8, (count, 3)).astype(np.float32)
    highlight = np.zeros_like(mask)
    highlight[:, 10:14, 10:14] = 0.2
    batch = {"mask": mask, "diffuse_shading": diffuse, "diffuse_albedo": albedo}
    gains = np.ones(3, np.float32)
    if cast is not None:
        batch["cast"] = np.broadcast_to(np.float32(cast), (count, 4))
        gains = camera_law.balance(batch["cast"], camera_law.places(size))
    linear = mask * gains * (albedo[:, None, None] * diffuse + highlight) + 0.1 * (1 - mask)
    batch["image"] = colour.linear_to_srgb(np.minimum(linear, 1)).astype(np.float32)
    return batch, highlight * gains


@pytest.fixture
def always(monkeypatch):
    """Print on every object."""
    monkeypatch.setattr(prints, "_PRINTED", 1.0)
    monkeypatch.setattr(prints, "_MOTTLED", 1.0)


@pytest.mark.parametrize("cast", [None, (0.1, 0.03, 0.05, -0.05)])
def test_under_a_print_the_light_is_that_of_another_paint(cast, always):
    batch, highlight = _batch(cast=cast)
    out = colour.srgb_to_linear(prints.add(batch, np.random.default_rng(0)))
    lit = batch["diffuse_shading"]
    if cast is not None:
        lit = lit * camera_law.balance(batch["cast"], camera_law.places(out.shape[1]))
    inside = np.broadcast_to(batch["mask"] == 1, out.shape) & (out < 0.99)
    painted = np.broadcast_to((out - highlight) / lit, out.shape)[inside]
    assert -1e-3 < painted.min() and painted.max() < 1.5
    before = colour.srgb_to_linear(batch["image"])
    assert (np.abs(out - before)[inside] > 0.02).mean() > 0.1


def test_outside_and_where_clipped_nothing_changes(always):
    batch, _ = _batch()
    batch["image"][:, 6:9] = 1.0
    out = prints.add(batch, np.random.default_rng(1))
    stays = np.broadcast_to(batch["mask"] == 0, out.shape)
    np.testing.assert_allclose(out[stays], batch["image"][stays], atol=1e-5)
    np.testing.assert_array_equal(out[:, 6:9], batch["image"][:, 6:9])
    assert out.dtype == np.float32 and 0 <= out.min() and out.max() <= 1


def test_most_objects_stay_as_they_were():
    batch, _ = _batch(count=200, size=16)
    out = prints.add(batch, np.random.default_rng(2))
    same = (out == batch["image"]).all(axis=(1, 2, 3)).mean()
    expected = (1 - prints._PRINTED) * (1 - prints._MOTTLED)
    assert abs(same - expected) < 0.12


def test_same_seed_same_prints_and_the_batch_stays():
    batch, _ = _batch()
    image = batch["image"].copy()
    one, other = (prints.add(batch, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(batch["image"], image)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_black_and_white_photos_stay_finite(value, always):
    batch, _ = _batch()
    batch["image"] = np.full_like(batch["image"], value)
    out = prints.add(batch, np.random.default_rng(4))
    assert np.isfinite(out).all()
