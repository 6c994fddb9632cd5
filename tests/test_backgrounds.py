"""Backgrounds: range, determinism, variety, and photographs of every kind."""

import numpy as np
import OpenImageIO as oiio
import pytest

from lime_keras.render import backgrounds


def write(path, pixels, orientation=1):
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.UINT8)
    spec.attribute("Orientation", orientation)
    image = oiio.ImageBuf(spec)
    image.set_pixels(oiio.ROI(), pixels.astype(np.float32))
    assert image.write(str(path)), image.geterror()
    return path


@pytest.mark.parametrize("seed", range(60))
def test_textures_are_pictures(seed):
    texture = backgrounds.procedural(np.random.default_rng(seed), 64)
    assert texture.shape == (64, 64, 3) and texture.dtype == np.float32
    assert np.isfinite(texture).all() and texture.min() >= 0 and texture.max() <= 1


@pytest.mark.parametrize("pattern", set(backgrounds.PATTERNS))
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
    path = write(tmp_path / "turned.jpg", pixels, orientation=6)  # shown turned clockwise
    crops = [backgrounds.photograph(path, np.random.default_rng(k), 32) for k in range(20)]
    assert max(np.ptp(crop.mean((1, 2))) for crop in crops) > 0.8
    assert max(np.ptp(crop.mean((0, 2))) for crop in crops) < 0.05


def test_unreadable_photographs_are_refused_by_name(tmp_path):
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match=r"none\.png: cannot be read"):
        backgrounds.photograph(tmp_path / "none.png", rng, 32)
    (tmp_path / "broken.png").write_bytes(b"not a picture")
    with pytest.raises(ValueError, match=r"broken\.png: cannot be read"):
        backgrounds.photograph(tmp_path / "broken.png", rng, 32)
    whole = write(tmp_path / "whole.png", np.random.default_rng(0).random((99, 99, 3)))
    (tmp_path / "cut.png").write_bytes(whole.read_bytes()[:9000])
    with pytest.raises(ValueError, match=r"cut\.png: cannot be read"):
        backgrounds.photograph(tmp_path / "cut.png", rng, 32)
