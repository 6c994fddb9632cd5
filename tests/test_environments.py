"""Environment maps: light is neither lost nor made, and unfit files are refused by name."""

import numpy as np
import OpenImageIO as oiio
import pytest

from lime_keras.environment import solid_angles
from lime_keras.render import environments


def integral(radiance):
    """Over the sphere, texel by texel: the slow reference."""
    height, width = radiance.shape
    total = 0.0
    for row in range(height):
        ring = np.cos(np.pi * row / height) - np.cos(np.pi * (row + 1) / height)
        total += 2 * np.pi / width * ring * radiance[row].astype(float).sum()
    return total


def write(path, texels):
    height, width, channels = texels.shape
    kind = oiio.FLOAT if texels.dtype == np.float32 else oiio.HALF
    image = oiio.ImageBuf(oiio.ImageSpec(width, height, channels, kind))
    image.set_pixels(oiio.ROI(), texels)
    assert image.write(str(path)), image.geterror()
    return path


def noise(height, channels=3, width=None):
    rng = np.random.default_rng(0)
    return rng.exponential(1.0, (height, width or 2 * height, channels)).astype(np.float32)


@pytest.mark.parametrize("height", [512, 96, 37])
@pytest.mark.parametrize("place", [(0, 0), (-1, 3), (0.5, 0), (0.5, -1), (0.21, 0.8)])
def test_a_point_of_light_keeps_its_energy_in_every_size(height, place):
    radiance = np.zeros((height, 2 * height), np.float32)
    row, column = (
        int(k * n) if isinstance(k, float) else k
        for k, n in zip(place, radiance.shape, strict=True)
    )
    radiance[row, column] = 1e4
    for smaller in (height, height - 1, height // 2, 32, 1):
        resized = environments.resized(radiance, smaller)
        assert resized.shape == (smaller, 2 * smaller)
        np.testing.assert_allclose(integral(resized), integral(radiance), rtol=1e-5)


def test_a_point_of_light_stays_where_it_is():
    radiance = np.zeros((256, 512), np.float32)
    radiance[100, 511] = 1.0
    for height in (128, 64, 32, 16):
        shrink = 256 // height
        lit = np.argwhere(environments.resized(radiance, height))
        np.testing.assert_array_equal(lit, [[100 // shrink, 511 // shrink]])


def test_a_constant_stays_constant():
    resized = environments.resized(np.full((333, 666), 3.0, np.float32), 100)
    np.testing.assert_allclose(resized, 3.0, rtol=1e-6)
    assert resized.dtype == np.float32


def test_halving_is_the_mean_of_two_by_two_by_solid_angle():
    radiance = noise(32)[..., 0]
    weight = solid_angles(32, 64)
    sums = (radiance * weight).reshape(16, 2, 32, 2).sum((1, 3))
    areas = weight.reshape(16, 2, 32, 2).sum((1, 3))
    np.testing.assert_allclose(environments.resized(radiance, 16), sums / areas, rtol=1e-5)


def test_the_integral_stays_at_the_extremes():
    radiance = noise(400)[..., 0] ** 12 * np.float32(1e10)
    resized = environments.resized(radiance, 77)
    assert np.isfinite(resized).all()
    np.testing.assert_allclose(integral(resized), integral(radiance), rtol=1e-5)


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_exr_is_read_as_luminance(tmp_path, channels, dtype):
    texels = noise(24, channels).astype(dtype)
    read = environments.load(write(tmp_path / "map.exr", texels))
    texels = texels.astype(np.float32)
    expected = texels[..., 0] if channels == 1 else texels[..., :3] @ [0.2126, 0.7152, 0.0722]
    assert read.shape == (24, 48) and read.dtype == np.float32
    np.testing.assert_allclose(read, expected, rtol=1e-5)


def test_hdr_is_read_as_luminance(tmp_path):
    texels = noise(24)
    read = environments.load(write(tmp_path / "map.hdr", texels))
    np.testing.assert_allclose(read, texels @ [0.2126, 0.7152, 0.0722], rtol=0.05)


def test_broken_texels_are_repaired_and_counted(tmp_path):
    texels = np.ones((16, 32, 1), np.float32)
    texels[[0, 1, 2, 3], 0, 0] = np.nan, np.inf, -np.inf, -2
    texels[5, 5] = 7
    path = write(tmp_path / "map.exr", texels)
    with pytest.warns(UserWarning, match=r"map\.exr: repaired 4 texels"):
        read = environments.load(path)
    np.testing.assert_array_equal(read[:4, 0], [0, 7, 0, 0])


@pytest.mark.parametrize(
    ("texels", "message"),
    [
        (noise(32, width=32), "is 32x32, expected twice as wide"),
        (np.zeros((16, 32, 3), np.float32), "is black everywhere"),
        (noise(16, channels=2), "has 2 channels, expected 1, 3 or 4"),
    ],
)
def test_unfit_maps_are_refused_by_name(tmp_path, texels, message):
    path = write(tmp_path / "unfit.exr", texels)
    with pytest.raises(ValueError, match=rf"unfit\.exr: {message}"):
        environments.load(path)


def test_missing_and_broken_files_are_refused_by_name(tmp_path):
    with pytest.raises(ValueError, match=r"none\.exr: cannot be read"):
        environments.load(tmp_path / "none.exr")
    (tmp_path / "broken.hdr").write_bytes(b"#?RADIANCE\n\nnothing")
    with pytest.raises(ValueError, match=r"broken\.hdr: "):
        environments.load(tmp_path / "broken.hdr")


def test_a_larger_size_is_refused():
    with pytest.raises(ValueError, match=r"20x10 cannot be averaged to 32x16.* at most 10 rows"):
        environments.resized(np.ones((10, 20), np.float32), 16)
