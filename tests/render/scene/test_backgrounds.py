"""Backgrounds: range, determinism, variety, and photographs of every kind."""

import os

import lying_headers
import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image
from written_pictures import oriented, write

from lime_keras.render import cli
from lime_keras.render.scene import backgrounds


@pytest.mark.parametrize("seed", range(60))
def test_textures_are_pictures(seed):
    texture = backgrounds.procedural(np.random.default_rng(seed), 64)
    assert texture.shape == (64, 64, 3) and texture.dtype == np.float32
    assert np.isfinite(texture).all() and texture.min() >= 0 and texture.max() <= 1


@pytest.mark.parametrize("pattern", dict.fromkeys(backgrounds.PATTERNS))
@pytest.mark.parametrize("size", [16, 97, 256])
def test_patterns_are_numbers_between_zero_and_one(pattern, size):
    for seed in range(10):
        values = pattern(np.random.default_rng(seed), size)
        assert values.shape == (size, size)
        assert np.isfinite(values).all() and values.min() >= 0 and values.max() <= 1 + 1e-6


def test_textures_are_a_function_of_the_generator():
    first, again, other = (backgrounds.procedural(np.random.default_rng(k), 64) for k in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.05


def test_textures_vary_in_colour_contrast_and_scale():
    textures = np.stack([backgrounds.procedural(np.random.default_rng(k), 64) for k in range(100)])
    means = textures.mean((1, 2))
    assert means.mean(1).std() > 0.1
    assert (np.ptp(means, axis=1) > 0.1).mean() > 0.2  # coloured
    contrast = textures.std((1, 2)).mean(1)
    assert (contrast > 0.05).mean() > 0.5 and (contrast < 1e-3).mean() < 0.05
    steps = np.abs(np.diff(textures, axis=2)).mean((1, 2, 3)) / np.maximum(contrast, 1e-3)
    assert np.percentile(steps, 90) > 4 * np.percentile(steps, 10)


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("size", [16, 200])
def test_photographs_are_cropped_and_resized(tmp_path, channels, size):
    x = np.linspace(0.2, 0.8, 90)[None, :, None]
    path = write(tmp_path / "photo.png", np.broadcast_to(x, (60, 90, channels)))
    for seed in range(8):
        crop = backgrounds.photograph(path, np.random.default_rng(seed), size)
        assert crop.shape == (size, size, 3) and crop.dtype == np.float32
        assert crop.min() > 0.19 and crop.max() < 0.81
        across = np.ptp(crop[size // 2, :, 0])
        assert 0.6 * 29 / 89 - 0.02 < across < 0.6 * 59 / 89 + 0.02
        assert np.ptp(crop, axis=0).max() < 0.02


def test_photographs_are_turned_upright(tmp_path):
    pixels = np.zeros((40, 60, 3))
    pixels[:, 30:] = 1
    path = write(tmp_path / "turned.jpg", pixels, Orientation=(6,))  # shown turned clockwise
    crops = [backgrounds.photograph(path, np.random.default_rng(k), 32) for k in range(20)]
    assert max(np.ptp(crop.mean((1, 2))) for crop in crops) > 0.8
    assert max(np.ptp(crop.mean((0, 2))) for crop in crops) < 0.05


@pytest.mark.parametrize("orientation", [0, 9])
def test_an_orientation_that_is_none_turns_nothing(tmp_path, orientation):
    pixels = np.full((40, 60, 3), 90, np.uint8)
    Image.fromarray(pixels).save(tmp_path / "a.jpg", exif=oriented(orientation))
    crop = backgrounds.photograph(tmp_path / "a.jpg", np.random.default_rng(0), 16)
    np.testing.assert_allclose(crop, 90 / 255, atol=0.02)


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "YCbCr", "I;16"])
def test_photographs_of_any_kind_are_read_as_colours(tmp_path, mode):
    colour = np.array([200, 100, 50], np.uint8)
    picture = Image.fromarray(np.broadcast_to(colour, (60, 90, 3)).copy())
    expected = colour / 255
    if mode == "I;16":
        picture = Image.fromarray(np.full((60, 90), 0x8000, np.uint16))
        expected = [0.5] * 3
    elif mode != "RGB":
        picture = picture.convert(mode)
        if mode in "1LA":
            expected = [np.asarray(picture.convert("L")).mean() / 255] * 3
    kind = {"CMYK": "jpg", "YCbCr": "jpg"}.get(mode, "png")
    picture.save(tmp_path / f"photo.{kind}")
    crop = backgrounds.photograph(tmp_path / f"photo.{kind}", np.random.default_rng(0), 32)
    np.testing.assert_allclose(crop.mean((0, 1)), expected, atol=0.03 if mode == "1" else 0.01)


@pytest.mark.parametrize("side", [8, 100, 127, 129, 500, 2000])
def test_photographs_of_any_size_keep_their_mean(tmp_path, side):
    """Whichever filter makes them fit."""
    x = np.linspace(0.2, 0.8, side)
    path = write(tmp_path / "photo.png", np.broadcast_to(x[:, None, None], (side, side, 3)))
    crop = backgrounds.photograph(path, np.random.default_rng(3), 64)
    along = crop.mean((1, 2))
    assert (np.diff(along) > -1 / 255).all() and np.ptp(crop, axis=1).max() < 1e-5
    np.testing.assert_allclose(along.mean(), along[[0, -1]].mean(), atol=0.01)


def test_photographs_may_begin_elsewhere_than_at_zero(tmp_path):
    spec = oiio.ImageSpec(60, 40, 3, oiio.UINT8)
    spec.x, spec.y, spec.full_width, spec.full_height = 500, 300, 600, 400
    image = oiio.ImageBuf(spec)
    oiio.ImageBufAlgo.fill(image, (0.5, 0.5, 0.5))
    assert image.write(str(tmp_path / "part.tif"))
    crop = backgrounds.photograph(tmp_path / "part.tif", np.random.default_rng(0), 32)
    np.testing.assert_allclose(crop, 0.5, atol=0.01)


def test_pixels_that_are_not_finite_are_black_and_told(tmp_path):
    pixels = np.full((40, 60, 3), 0.5, np.float32)
    pixels[:, :10, 1] = np.nan
    pixels[:, 10:20] = np.inf
    image = oiio.ImageBuf(pixels)
    assert image.write(str(tmp_path / "photo.tif"))
    picture, notes = backgrounds.read(tmp_path / "photo.tif")
    assert notes == ("800 pixels that were not finite are black",)
    np.testing.assert_array_equal(
        picture.get_pixels()[0, [0, 15, 30]], [[0.5, 0, 0.5], [0] * 3, [0.5] * 3]
    )
    assert backgrounds.read(write(tmp_path / "sound.png", pixels[:, 20:]))[1] == ()


@pytest.mark.parametrize("shape", [(1, 1, 3), (7, 300, 3), (300, 7, 1)])
def test_photographs_of_a_few_pixels_are_refused_by_name(tmp_path, shape):
    path = write(tmp_path / "dot.png", np.ones(shape))
    with pytest.raises(ValueError, match=r"dot\.png: is \d+x\d+, expected at least 8 pixels"):
        backgrounds.read(path)


def test_unreadable_photographs_are_refused_by_name(tmp_path):
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match=r"none\.png cannot be read"):
        backgrounds.photograph(tmp_path / "none.png", rng, 32)
    (tmp_path / "broken.png").write_bytes(b"not a picture")
    with pytest.raises(ValueError, match=r"broken\.png cannot be read"):
        backgrounds.photograph(tmp_path / "broken.png", rng, 32)
    whole = write(tmp_path / "whole.png", np.random.default_rng(0).random((99, 99, 3)))
    (tmp_path / "cut.png").write_bytes(whole.read_bytes()[:9000])
    with pytest.raises(ValueError, match=r"cut\.png cannot be read"):
        backgrounds.photograph(tmp_path / "cut.png", rng, 32)


@pytest.mark.parametrize("radiance", [1e-3, 1.0, 1e5])
def test_views_of_a_map_are_upright_exposed_and_of_the_train_split(tmp_path, radiance):
    """A red floor under a sky five stops brighter; the other map is kept for the test split."""
    maps = np.zeros((64, 128, 3), np.float32)
    maps[:32] = radiance * 32
    maps[32:, :, 0] = radiance
    for split in ("train", "test"):
        folder = tmp_path / "maps" / split
        folder.mkdir(parents=True)
        assert oiio.ImageBuf(maps).write(str(folder / f"{split}.exr"))
    out = tmp_path / "views"
    assert cli.main(["views", str(tmp_path / "maps"), str(out), "--count", "12"]) == 0
    paths = sorted(out.iterdir())
    assert [path.name for path in paths] == [f"train-{index:02d}.png" for index in range(12)]
    skies = 0
    for path in paths:
        picture = np.asarray(Image.open(path))
        assert picture.shape == (288, 384, 3)
        assert 0 < picture[..., 0].mean() <= 255 and picture[..., 0].max() > 64
        # Above the horizon all channels are alike, below it there is only red.
        sky = picture[..., 1].astype(float).mean(1) > 8
        assert (np.diff(sky.astype(int)) <= 0).all(), "the sky is above"
        skies += 0 < sky.sum() < len(sky)
    assert skies > 3


def test_a_map_that_cannot_be_looked_into_is_named(tmp_path, capsys):
    for split in ("train", "test"):
        (tmp_path / split).mkdir()
        (tmp_path / split / "broken.hdr").write_bytes(b"not a map")
    assert cli.main(["views", str(tmp_path), str(tmp_path / "views")]) == 1
    assert "broken.hdr cannot be read" in capsys.readouterr().err


def test_pipes_and_huge_headers_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "p.jpg")
    with pytest.raises(ValueError, match=r"p\.jpg cannot be read as a picture, it is a pipe"):
        backgrounds.read(tmp_path / "p.jpg")
    for make in (lying_headers.exr, lying_headers.png, lying_headers.tiff):
        path = make(tmp_path / f"huge.{make.__name__}", 20_000, 10_000)
        with pytest.raises(ValueError, match="has 20000×10000 pixels, more than the 134 million"):
            backgrounds.read(path)
