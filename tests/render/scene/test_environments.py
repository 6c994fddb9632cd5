"""Environment maps: light is neither lost nor made, and unfit files are refused by name."""

import os

import lying_headers
import numpy as np
import OpenImageIO as oiio
import pytest

from lime_keras.optics.environment import solid_angles
from lime_keras.render.corpus.random_example import Sources
from lime_keras.render.scene import environments, lights


def integral(radiance):
    """Over the sphere, texel by texel: the slow reference."""
    height, width = radiance.shape
    total = 0.0
    for row in range(height):
        ring = np.cos(np.pi * row / height) - np.cos(np.pi * (row + 1) / height)
        total += 2 * np.pi / width * ring * radiance[row].astype(float).sum()
    return total


def write(path, texels):
    image = oiio.ImageBuf(texels)
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


def test_hdr_is_read_as_luminance(tmp_path):
    texels = noise(24)
    read = environments.read(write(tmp_path / "map.hdr", texels))[0]
    np.testing.assert_allclose(read, texels @ [0.2126, 0.7152, 0.0722], rtol=0.05)


def test_broken_texels_are_repaired_and_counted(tmp_path):
    texels = np.ones((16, 32, 1), np.float32)
    texels[[0, 1, 2, 3], 0, 0] = np.nan, np.inf, -np.inf, -2
    texels[5, 5] = 7
    read, notes = environments.read(write(tmp_path / "map.exr", texels))
    np.testing.assert_array_equal(read[:4, 0], [0, 7, 0, 0])
    assert notes == ("repaired 4 texels that were negative or not finite",)


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_one_broken_channel_counts_one_texel_and_leaves_the_others(tmp_path, dtype):
    texels = np.full((600, 1200, 3), 2, dtype)  # of more rows than are converted at a time
    texels[590, 7] = np.nan, 1, 1
    texels[1, 1] = 5, 5, 5
    texels[599, 8] = np.inf, 1, -1
    read, notes = environments.read(write(tmp_path / "map.exr", texels))
    assert notes[0].startswith("repaired 2 texels")
    np.testing.assert_allclose(read[590, 7], 0.7152 + 0.0722, rtol=1e-5)
    np.testing.assert_allclose(read[599, 8], 5 * 0.2126 + 0.7152, rtol=1e-5)


@pytest.mark.parametrize("value", [1e-40, 1e-30, 1e30, np.finfo(np.float32).max])
def test_radiance_of_any_size_stays_finite(tmp_path, value):
    read = environments.read(write(tmp_path / "map.exr", np.full((4, 8, 3), value, np.float32)))[0]
    np.testing.assert_allclose(read / np.float32(value), 1, rtol=1e-4)


def write_exr(path, texels, names, kind="half", origin=(0, 0), window=None, **attributes):
    """An OpenEXR file whose data begin at `origin` in a window (width, height) at 0."""
    height, width, channels = texels.shape
    spec = oiio.ImageSpec(width, height, channels, kind)
    spec.channelnames = names
    spec.x, spec.y = origin
    spec.full_x = spec.full_y = 0
    spec.full_width, spec.full_height = window or (width, height)
    spec.tile_width = spec.tile_height = attributes.pop("tile", 0)
    for name, value in attributes.items():
        spec.attribute(name, value)
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), spec) and file.write_image(texels), file.geterror()
    file.close()
    return path


WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("kind", ["half", "float"])
@pytest.mark.parametrize("names", ["R", "Y", "Z", "RGB", "BGR", "RGBA", "ABGR", "RGBZ", "XYZ"])
def test_channels_are_known_by_their_names(tmp_path, names, kind):
    texels = noise(8, len(names)).astype(np.float16).astype(np.float32)
    read = environments.read(write_exr(tmp_path / "map.exr", texels, list(names), kind))[0]
    if {*"RGB"} <= {*names}:
        expected = texels[..., [names.index(name) for name in "RGB"]] @ WEIGHTS
    else:
        expected = texels[..., names.find("Y")]
    np.testing.assert_allclose(read, expected, rtol=1e-5)


def test_other_layers_are_left_alone_and_told(tmp_path):
    texels = noise(8, 6)
    names = ["R", "G", "B", "spare.R", "spare.G", "spare.B"]
    read, notes = environments.read(write_exr(tmp_path / "map.exr", texels, names, "float"))
    np.testing.assert_allclose(read, texels[..., :3] @ WEIGHTS, rtol=1e-5)
    assert notes == ("of 6 channels, R, G, B are used",)
    named = [f"view.{name}" for name in "RGB"]
    read = environments.read(write_exr(tmp_path / "map.exr", texels[..., :3], named, "float"))[0]
    np.testing.assert_allclose(read, texels[..., :3] @ WEIGHTS, rtol=1e-5)
    unclear = [f"{layer}.{name}" for layer in ("a", "b") for name in "RGB"]
    with pytest.raises(ValueError, match=r"map\.exr .* holds the layers a, b, and not one alone"):
        environments.read(write_exr(tmp_path / "map.exr", texels, unclear))


@pytest.mark.parametrize("names", [("depth", "rgba"), ("a", "b")])
def test_of_several_parts_the_picture_is_read(names, tmp_path):
    path = str(tmp_path / "parts.exr")
    specs = [oiio.ImageSpec(32, 16, 3, oiio.FLOAT) for _ in range(2)]
    for name, spec in zip(names, specs, strict=True):
        spec.attribute("oiio:subimagename", name)
    file = oiio.ImageOutput.create(path)
    assert file.open(path, specs) and file.write_image(noise(16) * 5)
    assert file.open(path, specs[1], "AppendSubimage") and file.write_image(noise(16))
    file.close()
    if "rgba" in names:
        np.testing.assert_allclose(environments.read(path)[0], noise(16) @ WEIGHTS, rtol=1e-5)
    else:
        with pytest.raises(ValueError, match=r"parts\.exr .* the layers a, b, and not one alone"):
            environments.read(path)


@pytest.mark.parametrize("tile", [0, 16])
@pytest.mark.parametrize(
    ("compression", "rtol"),
    [
        *(("none", 1e-5), ("rle", 1e-5), ("zip", 1e-5), ("zips", 1e-5), ("piz", 1e-5)),
        *(("pxr24", 1e-4), ("b44", 0.2), ("dwaa", 0.1), ("dwab", 0.1)),
    ],
)
def test_compressions_and_tiles_make_no_difference(tmp_path, compression, rtol, tile):
    texels = (1 + noise(32)).astype(np.float16).astype(np.float32)
    path = tmp_path / "map.exr"
    write_exr(path, texels, list("RGB"), compression=compression, tile=tile)
    np.testing.assert_allclose(environments.read(path)[0], texels @ WEIGHTS, rtol=rtol)


def test_data_are_read_in_their_window(tmp_path):
    """Cropped, more than the window, and moved: the window is the sphere."""
    texels = noise(16)
    luminance = texels @ WEIGHTS
    path = tmp_path / "map.exr"
    write_exr(path, texels[4:12, 8:24], list("RGB"), "float", (8, 4), (32, 16))
    read, notes = environments.read(path)
    np.testing.assert_allclose(read[4:12, 8:24], luminance[4:12, 8:24], rtol=1e-5)
    assert read.shape == (16, 32) and not read[:4].any() and not read[:, 24:].any()
    assert notes == ("75% of its display window holds no data: black",)
    wide = np.pad(texels, ((2, 2), (3, 3), (0, 0)), constant_values=9)
    read, notes = environments.read(write_exr(path, wide, list("RGB"), "float", (-3, -2), (32, 16)))
    np.testing.assert_allclose(read, luminance, rtol=1e-5)
    assert notes == ()


RUNS = b"\2\2\0\x20"  # how a scanline of 32 texels begins whose channels are run-length encoded


def radiance_file(path, resolution, runs=False, form="32-bit_rle_rgbe", rows=np.asarray):
    """A Radiance file of an image of rows of its own brightness, and its rows of RGBE bytes."""
    pixels = np.zeros((16, 32, 4), np.uint8)
    pixels[..., :3] = np.arange(128, 144)[:, None, None]
    pixels[..., :3] += np.arange(32, dtype=np.uint8)[:, None]
    pixels[..., 3] = 129 + np.arange(16)[:, None] % 3
    rows = rows(pixels)
    if runs:
        body = b"".join(
            RUNS + b"".join(b"\x20" + row[:, c].tobytes() for c in range(4)) for row in rows
        )
    else:
        body = np.ascontiguousarray(rows).tobytes()
    header = f"#?RADIANCE\nFORMAT={form}\nEXPOSURE=1\n\n{resolution}\n"
    path.write_bytes(header.encode() + body)
    mantissas = pixels[..., 0].astype(float) + 0.5
    return np.ldexp(mantissas, pixels[..., 3].astype(int) - 136)


@pytest.mark.parametrize(
    ("resolution", "runs", "rows"),
    [
        ("-Y 16 +X 32", False, lambda p: p),
        ("-Y 16 +X 32", True, lambda p: p),
        ("+Y 16 +X 32", True, lambda p: p[::-1]),
        ("-Y 16 -X 32", True, lambda p: p[:, ::-1]),
        ("+Y 16 -X 32", False, lambda p: p[::-1, ::-1]),
        ("+X 32 -Y 16", False, lambda p: p.swapaxes(0, 1)),
    ],
)
def test_radiance_files_are_turned_upright(tmp_path, resolution, rows, runs):
    expected = radiance_file(tmp_path / "map.hdr", resolution, runs, rows=rows)
    read = environments.read(tmp_path / "map.hdr")[0]
    np.testing.assert_allclose(read, expected, rtol=0.005)


def test_xyze_is_refused_by_name(tmp_path):
    radiance_file(tmp_path / "xyz.hdr", "-Y 16 +X 32", form="32-bit_rle_xyze")
    with pytest.raises(ValueError, match=r"xyz\.hdr cannot be read"):
        environments.read(tmp_path / "xyz.hdr")


@pytest.mark.parametrize("size", [(1, 2), (2, 4), (31, 63), (513, 1025), (515, 1015), (700, 1390)])
def test_maps_of_any_size_become_lights(tmp_path, size):
    """By the road that the renderer takes, from file to light."""
    rows, columns = size
    write(tmp_path / "a.exr", np.full((rows, columns, 1), 5, np.float32))
    light = Sources("train", 0, tmp_path, {"environments": [tmp_path / "a.exr"]}).light("a.exr")
    np.testing.assert_allclose(light.diffuse_shading, lights.MEAN_RADIANCE, rtol=0.01)


@pytest.mark.parametrize("extension", [".exr", ".hdr"])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.9])
def test_maps_that_are_cut_short_are_refused_by_name(tmp_path, extension, share):
    path = write(tmp_path / f"cut{extension}", noise(64))
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(ValueError, match=rf"cut\{extension} cannot be read"):
        environments.read(path)


@pytest.mark.parametrize("extension", [".exr", ".hdr"])
def test_a_picture_under_the_name_of_a_map_is_refused(tmp_path, extension):
    write(tmp_path / "sky.png", noise(16)).rename(tmp_path / f"sky{extension}")
    with pytest.raises(ValueError, match=rf"sky\{extension}: is a PNG file by its content"):
        environments.read(tmp_path / f"sky{extension}")


@pytest.mark.parametrize(
    ("texels", "message"),
    [
        (noise(32, width=32), ": is 32x32, expected twice as wide"),
        (np.zeros((16, 32, 3), np.float32), ": is black everywhere"),
        (noise(16, channels=2), ".* the channels R, G: name those of the picture R, G and B"),
    ],
)
def test_unfit_maps_are_refused_by_name(tmp_path, texels, message):
    path = write(tmp_path / "unfit.exr", texels)
    with pytest.raises(ValueError, match=rf"unfit\.exr{message}"):
        environments.read(path)


def test_missing_and_broken_files_are_refused_by_name(tmp_path):
    with pytest.raises(ValueError, match=r"none\.exr cannot be read"):
        environments.read(tmp_path / "none.exr")
    (tmp_path / "broken.hdr").write_bytes(b"#?RADIANCE\n\nnothing")
    with pytest.raises(ValueError, match=r"broken\.hdr cannot be read"):
        environments.read(tmp_path / "broken.hdr")


def test_pipes_and_huge_headers_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "sky.exr")
    with pytest.raises(ValueError, match=r"sky\.exr cannot be read as .*, it is a pipe"):
        environments.read(tmp_path / "sky.exr")
    path = lying_headers.exr(tmp_path / "huge.exr", 20_000, 10_000)
    with pytest.raises(ValueError, match="has 20000×10000 pixels, more than the 134 million"):
        environments.read(path)
    with pytest.raises(ValueError, match="huge"):
        environments.read(lying_headers.exr(path, 100_000, 50_000))


def test_a_display_window_far_larger_than_the_data_is_refused(tmp_path):
    image = oiio.ImageBuf(oiio.ImageSpec(16, 8, 3, oiio.HALF))
    image.specmod().full_width, image.specmod().full_height = 100_000, 50_000
    assert image.write(str(tmp_path / "window.exr"))
    with pytest.raises(ValueError, match="has 100000×50000 pixels, more than the 134 million"):
        environments.read(tmp_path / "window.exr")


def test_a_radiance_file_with_photoshops_empty_primaries_is_read_as_rec709(tmp_path):
    plain = write(tmp_path / "plain.hdr", noise(16))
    head, rest = plain.read_bytes().split(b"\n\n", 1)
    photoshop = tmp_path / "photoshop.hdr"
    photoshop.write_bytes(head + b"\nPRIMARIES=0 0 0 0 0 0 0 0\n\n" + rest)
    np.testing.assert_array_equal(environments.read(photoshop)[0], environments.read(plain)[0])
