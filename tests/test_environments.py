"""Environment maps: light is neither lost nor made, and unfit files are refused by name."""

import numpy as np
import OpenImageIO as oiio
import pytest
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


@pytest.mark.parametrize("height", [512, 300, 96, 37])
@pytest.mark.parametrize(
    "place", [(0, 0), (0, 5), (-1, 3), (0.5, 0), (0.5, -1), (0.5, 0.37), (0.21, 0.8)]
)
def test_a_point_of_light_keeps_its_energy_on_every_level(height, place):
    radiance = np.zeros((height, 2 * height), np.float32)
    row, column = (
        int(k * n) if isinstance(k, float) else k
        for k, n in zip(place, radiance.shape, strict=True)
    )
    radiance[row, column] = 1e4
    levels = environments.pyramid(radiance, height=512)
    for level in levels:
        np.testing.assert_allclose(integral(level), integral(radiance), rtol=1e-5)


def test_a_point_of_light_stays_where_it_is():
    radiance = np.zeros((256, 512), np.float32)
    radiance[100, 511] = 1.0
    for level in environments.pyramid(radiance):
        shrink = 256 // len(level)
        assert np.flatnonzero(level) == (100 // shrink) * level.shape[1] + 511 // shrink


def test_levels_halve_down_to_sixteen_rows():
    sizes = [level.shape for level in environments.pyramid(np.ones((1000, 2000), np.float32))]
    assert sizes == [(256, 512), (128, 256), (64, 128), (32, 64), (16, 32)]
    sizes = [level.shape for level in environments.pyramid(np.ones((70, 140), np.float32))]
    assert sizes == [(64, 128), (32, 64), (16, 32)]


def test_a_constant_stays_constant():
    for level in environments.pyramid(np.full((333, 666), 3.0, np.float32)):
        np.testing.assert_allclose(level, 3.0, rtol=1e-6)
        assert level.dtype == np.float32


def test_halving_is_the_mean_of_two_by_two_by_solid_angle():
    radiance = noise(32)[..., 0]
    weight = environments.solid_angles(32)[:, None]
    sums = (radiance * weight).reshape(16, 2, 32, 2).sum((1, 3))
    areas = np.broadcast_to(weight, (32, 64)).reshape(16, 2, 32, 2).sum((1, 3))
    np.testing.assert_allclose(environments.resized(radiance, 16), sums / areas, rtol=1e-5)


def test_solid_angles_cover_the_sphere():
    for height in (1, 2, 16, 501):
        np.testing.assert_allclose(environments.solid_angles(height).sum() * 2 * height, 4 * np.pi)


def test_random_maps_keep_their_integral_at_the_extremes():
    radiance = noise(400)[..., 0] ** 12 * np.float32(1e10)
    for level in environments.pyramid(radiance):
        assert np.isfinite(level).all()
        np.testing.assert_allclose(integral(level), integral(radiance), rtol=1e-5)


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


def test_unfit_sizes_are_refused():
    with pytest.raises(ValueError, match="height is 100, expected one of"):
        environments.pyramid(np.ones((256, 512), np.float32), height=100)
    with pytest.raises(ValueError, match="the map is 20x10, expected at least 32x16"):
        environments.pyramid(np.ones((10, 20), np.float32))
    with pytest.raises(ValueError, match="larger"):
        environments.resized(np.ones((10, 20), np.float32), 16)
