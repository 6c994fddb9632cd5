"""Cut-outs: composed of photographs in linear light, with true coverage."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lime_keras.optics import colour
from lime_keras.train.photos import cutouts
from lime_keras.train.photos.cutouts import Cutouts

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
    for name in ("_PAPER", "_SHADED", "_BRIGHTNESS"):
        monkeypatch.setattr(cutouts, name, 0.0)
    monkeypatch.setattr(cutouts, "_OFF_CENTRE", 0.0)


BLUE = float(colour.srgb_to_linear(128 / 255))


def _compose(some, seed):
    return some.compose(np.random.default_rng(seed))


def test_the_same_generator_gives_the_same_scene(folders):
    some = Cutouts(*folders, SIZE)
    first, again, other = (_compose(some, seed) for seed in (5, 5, 6))
    assert all(map(np.array_equal, first, again)) and not np.array_equal(first[0], other[0])
    for one, channels in zip(first, (3, 3, 1), strict=True):
        assert one.shape == (SIZE, SIZE, channels) and one.dtype == np.float32 and one.min() >= 0


def test_light_is_shared_by_coverage(folders, monkeypatch):
    _plain(monkeypatch)
    some = Cutouts(*folders, SIZE)
    for seed in range(8):
        light, behind, mask = _compose(some, seed)
        np.testing.assert_allclose(behind[..., 2:], BLUE * (1 - mask), atol=0.01)
        assert not light[mask[..., 0] == 0].any() and light[..., 2].max() < 0.01
        # The darkest and the brightest colour of the thing, in linear light.
        straight = light[mask[..., 0] == 1][:, :2]
        assert colour.srgb_to_linear(38 / 255) < straight.min() and straight.max() <= 1.001
        y, x = np.indices((SIZE, SIZE)) + 0.5
        weight = mask[..., 0] / mask.sum()
        np.testing.assert_allclose(((x * weight).sum(), (y * weight).sum()), SIZE / 2, atol=0.5)


@pytest.mark.parametrize("extent", [0.5, 1.0])
def test_a_thing_has_its_extent(folders, extent, monkeypatch):
    _plain(monkeypatch)
    monkeypatch.setattr(cutouts, "_EXTENT", (extent, extent))
    mask = _compose(Cutouts(*folders, SIZE), 0)[2]
    assert mask.sum() == pytest.approx(np.pi / 4 * (extent * SIZE) ** 2, rel=0.06)


def test_a_shadow_darkens_what_is_behind_and_is_no_part_of_the_mask(folders, monkeypatch):
    _plain(monkeypatch)
    some = Cutouts(*folders, SIZE)
    light, plain, mask = _compose(some, 3)
    monkeypatch.setattr(cutouts, "_SHADED", 1.0)
    same, shaded, again = _compose(some, 3)
    darker = (plain - shaded)[..., 2]
    assert darker.max() > 0.02 and darker.min() > -1e-6
    np.testing.assert_array_equal(light, same)
    np.testing.assert_array_equal(mask, again)


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
