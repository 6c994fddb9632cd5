"""Cut-outs: composed of photographs, with true coverage."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lime_keras.data import cutouts
from lime_keras.data.cutouts import Cutouts

SIZE = 32


@pytest.fixture
def folders(tmp_path):
    """Return a folder with one disc in many colours, and one with a photograph in blue."""
    things, places = tmp_path / "things" / "inner", tmp_path / "places"
    things.mkdir(parents=True)
    places.mkdir()
    _save(things / "disc.png", _disc())
    blue = np.zeros((60, 80, 3), np.uint8)
    blue[..., 2] = 128
    _save(places / "blue.webp", blue)
    return tmp_path / "things", places


def _disc(side=100, margin=10):
    """Return a round thing without blue, `(side, side, 4)` uint8."""
    generator = np.random.default_rng(0)
    y, x = np.indices((side, side)) - side / 2 + 0.5
    colours = generator.integers(40, 256, (side, side, 4), dtype=np.uint8)
    colours[..., 2] = 0
    colours[..., 3] = 255 * (np.hypot(x, y) < side / 2 - margin)
    return colours


def _save(path: Path, pixels: np.ndarray) -> None:
    Image.fromarray(pixels).save(path)


def _plain(monkeypatch):
    """Leave out what changes colours and places."""
    for name in ("_PAPER", "_SHADED", "_BRIGHTNESS", "_BLUR", "_NOISE"):
        monkeypatch.setattr(cutouts, name, 0.0)
    monkeypatch.setattr(cutouts, "_OFF_CENTRE", 0.0)


def _batch(count=8):
    images = np.full((count, SIZE, SIZE, 3), 0.5, np.float32)
    return images, np.zeros((count, SIZE, SIZE, 1), np.float32)


def test_half_of_a_batch_shows_cut_outs_and_the_rest_stays(folders):
    images, masks = _batch()
    seen, covers = Cutouts(*folders, SIZE).put(images, masks, np.random.default_rng(1))
    assert seen.shape == images.shape and covers.shape == masks.shape
    assert seen.dtype == covers.dtype == np.float32
    assert 0 <= seen.min() and seen.max() <= 1 and 0 <= covers.min() and covers.max() <= 1
    changed = (seen != images).any(axis=(1, 2, 3))
    np.testing.assert_array_equal(changed, 4 * [True] + 4 * [False])
    np.testing.assert_array_equal(covers.any(axis=(1, 2, 3)), changed)
    assert not masks.any()


def test_the_same_generator_gives_the_same_images(folders):
    some = Cutouts(*folders, SIZE)
    first, again = (some.put(*_batch(), np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])


def test_the_mask_is_where_the_thing_covers_the_place(folders, monkeypatch):
    _plain(monkeypatch)
    some = Cutouts(*folders, SIZE)
    for seed in range(8):
        images, masks = some.put(*_batch(4), np.random.default_rng(seed))
        blue = images[0, ..., 2]
        np.testing.assert_allclose(blue, 128 / 255 * (1 - masks[0, ..., 0]), atol=0.01)
        y, x = np.indices((SIZE, SIZE)) + 0.5
        weight = masks[0, ..., 0] / masks[0].sum()
        np.testing.assert_allclose(((x * weight).sum(), (y * weight).sum()), SIZE / 2, atol=0.5)


@pytest.mark.parametrize("extent", [0.5, 1.0])
def test_a_thing_has_its_extent(folders, extent, monkeypatch):
    _plain(monkeypatch)
    monkeypatch.setattr(cutouts, "_EXTENT", (extent, extent))
    _, masks = Cutouts(*folders, SIZE).put(*_batch(4), np.random.default_rng(0))
    assert masks[0].sum() == pytest.approx(np.pi / 4 * (extent * SIZE) ** 2, rel=0.06)


def test_a_shadow_darkens_what_is_behind_and_is_no_part_of_the_mask(folders, monkeypatch):
    _plain(monkeypatch)
    some = Cutouts(*folders, SIZE)
    plain, _ = some.put(*_batch(4), np.random.default_rng(3))
    monkeypatch.setattr(cutouts, "_SHADED", 1.0)
    shaded, masks = some.put(*_batch(4), np.random.default_rng(3))
    outside = masks[0, ..., 0] == 0
    darker = plain[0, ..., 2] - shaded[0, ..., 2]
    assert darker[outside].max() > 0.02 and darker[outside].min() > -1e-3
    inside = masks[0, ..., 0] == 1
    np.testing.assert_allclose(shaded[0][inside], plain[0][inside], atol=1e-6)


def test_letters_small_pictures_and_whole_photographs_are_left_out(folders):
    things, places = folders
    letter = _disc()
    letter[..., :3] = 0
    _save(things / "letter.png", letter)
    _save(things / "small.png", _disc(40, 2))
    _save(things / "tiny.png", _disc(10, 1))
    _save(things / "photograph.png", _disc()[..., :3])
    _save(things / "empty.png", np.zeros((100, 100, 4), np.uint8))
    assert len(Cutouts(things, places, SIZE)._things) == 1
    (things / "inner" / "disc.png").unlink()
    with pytest.raises(FileNotFoundError, match="things holds no cut-out"):
        Cutouts(things, places, SIZE)


def test_a_folder_without_pictures_is_named(folders, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(
        FileNotFoundError, match="empty holds no PNG or WebP pictures: check --cutouts"
    ):
        Cutouts(folders[0], empty, SIZE)
    with pytest.raises(FileNotFoundError, match="empty holds no PNG or WebP pictures"):
        cutouts.sha256(empty, folders[1])


def test_a_broken_picture_is_named(folders):
    (folders[0] / "broken.png").write_bytes(b"no picture")
    with pytest.raises(ValueError, match=r"broken\.png"):
        Cutouts(*folders, SIZE)


def test_the_hash_follows_names_and_bytes(folders):
    first = cutouts.sha256(*folders)
    assert cutouts.sha256(*folders) == first
    path = folders[1] / "blue.webp"
    path.rename(folders[1] / "other.png")
    renamed = cutouts.sha256(*folders)
    _save(folders[1] / "other.png", np.zeros((60, 80, 3), np.uint8))
    assert len({first, renamed, cutouts.sha256(*folders)}) == 3
