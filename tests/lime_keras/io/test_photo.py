"""Pictures of every format in and out, and files that are none."""

import os
import struct
import time

import full_disk
import icc_profiles
import lying_headers
import numpy as np
import OpenImageIO as oiio
import pillow_heif
import pytest
from PIL import Image, ImageCms
from written_pictures import oriented, write

from lime_keras.io import photo, untrusted
from lime_keras.optics import colour


def noise(channels=3, height=20, width=28):
    return np.random.default_rng(0).uniform(size=(height, width, channels)).astype(np.float32)


@pytest.mark.parametrize("kind, levels", [(oiio.UINT8, 255), (oiio.UINT16, 65535)])
def test_png_keeps_its_levels(tmp_path, kind, levels):
    pixels = np.round(noise() * levels) / levels
    found = photo.read_srgb(write(tmp_path / "photo.png", pixels, kind))
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, pixels, atol=1e-6)


@pytest.mark.parametrize("kind", [oiio.UINT8, oiio.UINT16])
def test_grey_is_repeated(tmp_path, kind):
    pixels = noise(1)
    found = photo.read_srgb(write(tmp_path / "grey.png", pixels, kind))
    assert found.shape == (20, 28, 3)
    np.testing.assert_allclose(found, np.repeat(pixels, 3, axis=-1), atol=0.5 / 255 + 1e-6)


def test_alpha_is_dropped(tmp_path):
    pixels = np.concatenate([noise(), np.ones((20, 28, 1))], axis=-1)
    found = photo.read_srgb(write(tmp_path / "alpha.png", pixels))
    np.testing.assert_allclose(found, pixels[..., :3], atol=0.5 / 255 + 1e-6)
    grey = write(tmp_path / "grey_alpha.tif", pixels[..., 2:])
    found = photo.read_srgb(grey)
    np.testing.assert_allclose(found, np.repeat(pixels[..., 2:3], 3, -1), atol=0.5 / 255 + 1e-6)


@pytest.mark.parametrize("suffix", ["exr", "hdr"])
def test_linear_formats_are_encoded_and_clipped(tmp_path, suffix):
    linear = noise() * 2
    linear[0, 0] = 0
    found = photo.read_srgb(write(tmp_path / f"linear.{suffix}", linear, oiio.FLOAT))
    assert found.min() == 0 and 0.999 < found.max() <= 1 and found.dtype == np.float32
    # Radiance's shared exponent keeps 8 bits of the brightest channel.
    np.testing.assert_allclose(colour.srgb_to_linear(found), np.clip(linear, 0, 1), atol=0.01)


def test_linear_grey_is_encoded_too(tmp_path):
    found = photo.read_srgb(write(tmp_path / "grey.exr", np.full((20, 30, 1), 0.25), oiio.HALF))
    np.testing.assert_allclose(found, 0.5370987, atol=1e-3)


@pytest.mark.parametrize("orientation", [0, 9, 255])
def test_an_orientation_that_is_none_turns_nothing(tmp_path, orientation):
    pixels = np.zeros((16, 24, 3), np.uint8)
    pixels[:, :12] = 255
    Image.fromarray(pixels).save(tmp_path / "a.jpg", exif=oriented(orientation), quality=95)
    found = photo.read_srgb(tmp_path / "a.jpg")
    np.testing.assert_allclose(found, pixels / 255, atol=0.05)


@pytest.mark.parametrize("shape", [(16, 16), (16, 3000), (3000, 16)])
def test_pictures_of_every_shape(tmp_path, shape):
    assert photo.read_srgb(write(tmp_path / "p.png", noise(3, *shape))).shape == (*shape, 3)


@pytest.mark.parametrize("shape", [(1, 1), (15, 400), (400, 15)])
@pytest.mark.parametrize("suffix", ["png", "heic"])
def test_pictures_too_small_to_show_an_object_are_named(tmp_path, shape, suffix):
    path = save(tmp_path / f"p.{suffix}", np.zeros((*shape, 3), np.uint8))
    refused(path, reason=f"has {shape[1]}×{shape[0]} pixels, too few")


@pytest.mark.parametrize("shape", [(16, 4_100), (4_100, 16)])
def test_a_picture_like_a_thread_is_named(tmp_path, shape):
    path = save(tmp_path / "p.png", np.zeros((*shape, 3), np.uint8))
    refused(path, reason=f"has {shape[1]}×{shape[0]} pixels, more than 256 times as many one way")


def test_pictures_too_large_are_named_before_they_are_decoded(tmp_path):
    path = save(tmp_path / "huge.png", np.zeros((7_100, 7_100), bool))
    refused(path, reason="has 7100×7100 pixels, more than the 50 million")


# Pictures as others write them.


def save(path, levels, mode=None, **options):
    """Write with Pillow, another library than the one that reads."""
    pillow_heif.register_heif_opener()
    image = Image.fromarray(levels)
    if mode:
        image = image.convert(mode, palette=Image.Palette.ADAPTIVE)
    image.save(path, **options)
    return path


def chart():
    """Four patches of 16 pixels: red, green, blue and grey."""
    colours = np.array([[200, 30, 20], [20, 180, 40], [30, 60, 220], [128, 128, 128]], np.uint8)
    return np.repeat(np.repeat(colours[None], 16, axis=0), 16, axis=1)


KINDS = {
    "JPEG": ("p.jpg", None, {"quality": 95, "subsampling": 0}, 6),
    "CMYK JPEG": ("p.jpg", "CMYK", {"quality": 95}, 6),
    "CMYK TIFF": ("p.tif", "CMYK", {}, 6),
    "palette PNG": ("p.png", "P", {}, 1),
    "GIF": ("p.gif", "P", {}, 1),
    "WebP": ("p.webp", None, {"lossless": True}, 1),
    "BMP": ("p.bmp", None, {}, 1),
    "HEIC": ("p.heic", None, {"quality": 95}, 12),
    "JPEG 2000": ("p.jp2", None, {}, 1),
}


@pytest.mark.parametrize("kind", KINDS)
def test_colours_of_every_kind_of_file(tmp_path, kind):
    name, mode, options, tolerance = KINDS[kind]
    found, _, cautions = photo.load(save(tmp_path / name, chart(), mode, **options))
    # Which inks they are is not known without a profile.
    assert [told.code for told in cautions] == ["colours-unknown"] * (mode == "CMYK")
    # Away from the patches' borders, where chroma bleeds.
    centres = np.s_[8, 8::16]
    np.testing.assert_allclose(found[centres] * 255, chart()[centres], atol=tolerance)


# Display P3's primaries in XYZ under D50, as columns of red, green and blue (SMPTE EG 432-1).
P3 = np.array(
    [[0.51512, 0.29198, 0.15710], [0.24120, 0.69225, 0.06657], [-0.00105, 0.04189, 0.78407]]
)


def profile(space=b"RGB ", description="Display P3"):
    """A profile of P3's primaries and sRGB's curve."""
    return icc_profiles.profile(icc_profiles.FORMULA, P3, name=description, space=space)


def in_srgb(p3):
    """The same colours, by the definition."""
    linear = (
        colour.srgb_to_linear(p3.astype(np.float64))
        @ P3.T
        @ np.linalg.inv(icc_profiles.TO_XYZ_D50).T
    )
    return colour.linear_to_srgb(np.clip(linear, 0, 1))


@pytest.mark.parametrize("suffix", ["png", "tif", "webp", "heic"])
def test_a_profile_is_converted_from(tmp_path, suffix):
    levels = (noise() * 255).astype(np.uint8)
    lossless = {"webp": {"lossless": True}, "heic": {"quality": -1, "chroma": 444}}
    lossless = lossless.get(suffix, {})
    path = save(tmp_path / f"phone.{suffix}", levels, icc_profile=profile(), **lossless)
    found = photo.read_srgb(path)
    plain = photo.read_srgb(save(tmp_path / f"kept.{suffix}", levels, **lossless))
    assert np.abs(found - in_srgb(plain)).max() < 1.6 / 255
    assert np.abs(found - plain).max() > 20 / 255


@pytest.mark.parametrize(
    "content", [profile(b"GRAY"), profile()[:200], b"no profile"], ids=["grey", "cut off", "none"]
)
def test_a_profile_that_does_not_apply_changes_nothing_and_is_told(tmp_path, content):
    levels = (noise() * 255).astype(np.uint8)
    Image.fromarray(levels).save(tmp_path / "photo.png", icc_profile=content)
    with pytest.warns(photo.PhotoWarning, match="read as sRGB, but its profile is"):
        found = photo.read_srgb(tmp_path / "photo.png")
    np.testing.assert_allclose(found, levels / 255, atol=1e-6)


def test_a_profile_of_srgb_changes_nothing(tmp_path):
    levels = (noise() * 255).astype(np.uint8)
    content = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.fromarray(levels).save(tmp_path / "photo.png", icc_profile=content)
    np.testing.assert_allclose(photo.read_srgb(tmp_path / "photo.png"), levels / 255, atol=1e-6)


@pytest.mark.parametrize("name", ["sRGB IEC61966-2.1", "Display P3"])
def test_a_profile_is_taken_by_its_values_not_by_its_name(tmp_path, name):
    levels = (noise() * 255).astype(np.uint8)
    Image.fromarray(levels).save(tmp_path / "photo.png", icc_profile=profile(description=name))
    expected = in_srgb(levels / 255)
    assert np.abs(photo.read_srgb(tmp_path / "photo.png") - expected).max() < 1.6 / 255


def test_a_heics_exif_does_not_turn_it(tmp_path):
    """HEIF has a rotation of its own, which the decoder applies; EXIF's only repeats it."""
    path = save(tmp_path / "turned.heic", np.zeros((32, 48, 3), np.uint8), exif=oriented(6))
    assert photo.read_srgb(path).shape == (32, 48, 3)


def test_grey_of_two_bytes_and_of_one_bit(tmp_path):
    deep = np.full((16, 16), 30_000, np.uint16)
    found = photo.read_srgb(save(tmp_path / "deep.png", deep))
    np.testing.assert_allclose(found, 30_000 / 65_535, atol=1e-5)
    bits = np.eye(16, dtype=np.uint8) * 255
    found = photo.read_srgb(save(tmp_path / "bits.png", bits, "1"))
    np.testing.assert_array_equal(found[..., 1], np.eye(16))


# Transparency and masks.


@pytest.mark.parametrize("suffix", ["png", "webp", "heic"])
def test_a_cut_out_brings_its_mask(tmp_path, suffix):
    levels = np.full((32, 32, 4), 200, np.uint8)
    levels[..., 3] = 255
    levels[:16, :, 3] = 0
    options = {"quality": 95} if suffix == "heic" else {"lossless": True}
    options = {} if suffix == "png" else options
    image, alpha = photo.read(save(tmp_path / f"cut.{suffix}", levels, **options))
    assert image.shape == (32, 32, 3) and alpha.shape == (32, 32, 1)
    assert alpha[:14].max() < 0.1 and alpha[18:].min() > 0.9
    assert image[:14].max() < 0.1
    np.testing.assert_allclose(image[18:], 200 / 255, atol=0.03)


def test_opaque_alpha_is_no_mask(tmp_path):
    levels = np.full((16, 16, 4), 255, np.uint8)
    assert photo.read(save(tmp_path / "opaque.png", levels))[1] is None
    assert photo.read(save(tmp_path / "rgb.png", levels[..., :3]))[1] is None


def test_masks_of_every_kind(tmp_path):
    expected = np.zeros((20, 30, 1), np.float32)
    expected[5:15, 8:20] = 1
    grey = (expected[..., 0] * 255).astype(np.uint8)
    colour_ = np.repeat(grey[..., None], 3, axis=-1)
    cut_out = np.concatenate([np.full((20, 30, 3), 9, np.uint8), grey[..., None]], axis=-1)
    for name, levels in (("grey", grey), ("colour", colour_), ("cut-out", cut_out)):
        found = photo.read_mask(save(tmp_path / f"{name}.png", levels), 20, 30)
        np.testing.assert_array_equal(found, expected)


def test_coverage_has_no_curve(tmp_path):
    coverage = np.linspace(0, 1, 20 * 28, dtype=np.float32).reshape(20, 28, 1)
    path = write(tmp_path / "mask.exr", coverage, oiio.FLOAT)
    np.testing.assert_allclose(photo.read_coverage(path, 20, 28), coverage, atol=1e-6)


def test_radiance_is_read_as_it_is_stored(tmp_path):
    layer = noise(1) * 60_000
    layer[0, 0] = 0  # unlit is radiance, too
    found = photo.read_radiance(write(tmp_path / "layer.exr", layer, oiio.FLOAT), 20, 28)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, layer)
    for name, pixels, kind, told in (
        ("grey.png", noise(1), oiio.UINT8, "is no OpenEXR: write linear radiance as one"),
        ("colour.exr", noise(3), oiio.HALF, "has 3 channels: a grey layer has one"),
        ("negative.exr", noise(1) - 2, oiio.HALF, "holds -2: radiance is at least 0, so clip it"),
        ("nan.exr", noise(1) + np.nan, oiio.HALF, "holds NaN or infinite pixels"),
        ("large.exr", noise(1, 40, 56), oiio.HALF, "has 56×40 pixels and its photo 28×20"),
    ):
        with pytest.raises(ValueError, match=f"{name} {told}"):
            photo.read_radiance(write(tmp_path / name, pixels, kind), 20, 28)


def test_masks_of_another_size_and_black_ones_are_named(tmp_path):
    path = save(tmp_path / "mask.png", np.zeros((20, 30), np.uint8))
    assert not photo.read_coverage(path, 20, 30).any()
    with pytest.raises(ValueError, match=r"mask\.png is nowhere white"):
        photo.read_mask(path, 20, 30)
    with pytest.raises(ValueError, match="has 30×20 pixels and its photo 20×30"):
        photo.read_mask(path, 30, 20)


def refused(path, reason="cannot be read as a picture"):
    with pytest.raises(ValueError, match=rf"{path.name} {reason}"):
        photo.read_srgb(path)


@pytest.mark.parametrize("name", ["none.png", "none.exr", "none.txt", "none"])
def test_a_missing_file_and_a_folder_are_named(name, tmp_path):
    refused(tmp_path / name)
    (tmp_path / name).mkdir()
    refused(tmp_path / name)


@pytest.mark.parametrize(
    "name", ["broken.png", "broken.jpg", "broken.exr", "broken.txt", "broken.heic"]
)
@pytest.mark.parametrize("content", [b"", b"not a picture at all"])
def test_a_file_that_is_no_picture_is_named(name, content, tmp_path):
    (tmp_path / name).write_bytes(content)
    refused(tmp_path / name)


@pytest.mark.parametrize("suffix", ["png", "exr", "tif"])
def test_a_picture_cut_off_is_named(suffix, tmp_path):
    path = write(tmp_path / f"whole.{suffix}", noise(3, 64, 64), oiio.UINT8)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    refused(path)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_pixels_that_are_not_finite_are_named(value, tmp_path):
    pixels = noise()
    pixels[1, 2, 0] = value
    refused(write(tmp_path / "nan.exr", pixels, oiio.FLOAT), reason="holds NaN or infinite")


@pytest.mark.parametrize("progressive", [False, True])
def test_a_jpeg_cut_off_anywhere_is_named(progressive, tmp_path):
    levels = np.uint8(255 * noise(3, 64, 64))
    path = save(tmp_path / "p.jpg", levels, progressive=progressive, quality=80)
    data = path.read_bytes()
    photo.read(path)
    for kept in (*range(2, len(data), 97), len(data) - 2, len(data) - 1):
        path.write_bytes(data[:kept])
        refused(path)
        path.write_bytes(data[:kept] + bytes(len(data) - kept))  # as downloads leave it
        refused(path)


def test_the_end_of_a_jpegs_thumbnail_is_not_its_own(tmp_path):
    """A segment is passed over by its length, whatever lies in it."""
    path = save(tmp_path / "p.jpg", np.uint8(255 * noise(3, 64, 64)), comment=b"\xff\xd9" * 9)
    path.write_bytes(path.read_bytes()[:-20])
    refused(path)


def test_what_follows_a_jpegs_end_does_no_harm(tmp_path):
    # Phones append a short film, and put thumbnails, JPEGs themselves, into the header.
    path = save(tmp_path / "p.jpg", np.uint8(255 * noise(3, 64, 64)), comment=b"\xff\xd9" * 9)
    expected = photo.read_srgb(path)
    path.write_bytes(path.read_bytes() + b"\xff\xda film \xff")
    np.testing.assert_array_equal(photo.read_srgb(path), expected)
    restarts = save(tmp_path / "r.jpg", np.uint8(255 * noise(3, 64, 64)), restart_marker_blocks=1)
    photo.read(restarts)


@pytest.mark.parametrize(
    "error", [IndexError("list index"), EOFError(), KeyError(3), struct.error(), AssertionError()]
)
def test_whatever_a_decoder_raises_names_the_file(error, tmp_path, monkeypatch):
    path = save(tmp_path / "p.heic", chart())

    def broken(*_, **__):
        raise error

    monkeypatch.setattr(pillow_heif, "HeifImageFile", broken)
    refused(path, reason="cannot be read as a picture: .")


def test_too_little_memory_names_the_file(tmp_path, monkeypatch):
    path = save(tmp_path / "p.heic", chart())

    def large(*_, **__):
        raise MemoryError

    monkeypatch.setattr(pillow_heif, "HeifImageFile", large)
    with pytest.raises(MemoryError, match=r"p\.heic does not fit into this machine's memory: make"):
        photo.read(path)


@pytest.mark.parametrize("name", ["p.jpg", "p.heic", "p.exr"])
def test_a_pipe_and_a_device_are_named(name, tmp_path):
    os.mkfifo(tmp_path / name)
    refused(tmp_path / name, reason="cannot be read as a picture, it is a pipe: pass a file")
    (tmp_path / "link.jpg").symlink_to("/dev/zero")
    refused(tmp_path / "link.jpg", reason="cannot be read as a picture, it is a device: pass a f")


def test_a_name_that_is_not_utf8_is_refused(tmp_path):
    path = tmp_path / os.fsdecode(b"caf\xe9.png")
    save(tmp_path / "p.png", chart()).rename(path)
    with pytest.raises(ValueError, match="its name is not UTF-8: rename it"):
        photo.read(path)


@pytest.mark.parametrize("write_header", [lying_headers.exr, lying_headers.png, lying_headers.tiff])
def test_a_header_that_announces_too_much_is_refused(write_header, tmp_path):
    path = write_header(tmp_path / f"p.{write_header.__name__}", 8_000, 7_000)
    refused(path, reason="has 8000×7000 pixels, more than the 50 million")
    refused(write_header(path, 100_000, 50_000), reason="")
    refused(write_header(path, 300, 300))


def test_too_many_channels_are_refused(tmp_path):
    path = tmp_path / "p.exr"
    write(path, np.zeros((16, 16, 50)), oiio.HALF)
    assert photo.load(path).image.shape == (16, 16, 3)
    with pytest.raises(ValueError, match="has 50 channels of 7000×7000 pixels, more than the 200"):
        untrusted.check_size(path, 7000, 7000, 50, photo.LARGEST)


# Photos that are too large to be worked on at full size.


@pytest.mark.parametrize("suffix", ["png", "heic"])
def test_a_large_photo_is_read_smaller_and_its_mask_alike(suffix, tmp_path, monkeypatch):
    levels = np.zeros((45, 61, 4), np.uint8)
    levels[:, :, 0], levels[20:, :, 1], levels[..., 3] = 255, 128, 255
    levels[:10, :20, 3] = 0
    path = save(tmp_path / f"p.{suffix}", levels)
    monkeypatch.setattr(photo, "FULL", 45 * 61)
    whole, alpha = photo.read(path)
    assert whole.shape == (45, 61, 3)  # the largest that is read at full size
    monkeypatch.setattr(photo, "FULL", 1000)
    with pytest.warns(UserWarning, match=r"61×45 pixels.*it is read at 31×23, and so are its lay"):
        image, opacity = photo.read(path)
    assert image.shape == (23, 31, 3) and opacity.shape == (23, 31, 1)
    blocks = colour.srgb_to_linear(whole[:44, :60]).reshape(22, 2, 30, 2, 3).mean((1, 3))
    np.testing.assert_allclose(image[:22, :30], colour.linear_to_srgb(blocks), atol=1e-5)
    ends = colour.linear_to_srgb(colour.srgb_to_linear(whole[44, 60]))
    np.testing.assert_allclose(image[22, 30], ends, atol=1e-5)
    areas = alpha[:44, :60].reshape(22, 2, 30, 2, 1).mean((1, 3))
    np.testing.assert_allclose(opacity[:22, :30], areas, atol=1e-6)
    mask = save(tmp_path / "mask.png", np.full((45, 61), 255, np.uint8))
    assert photo.read_mask(mask, 23, 31).shape == (23, 31, 1)
    assert photo.read_mask(mask, 45, 61).shape == (45, 61, 1)  # of an array that is not read
    # Coverage is averaged as it is, as an alpha channel's.
    stripes = np.zeros((45, 61), np.uint8)
    stripes[:, ::2] = 255
    found = photo.read_mask(save(tmp_path / "stripes.png", stripes), 23, 31)
    np.testing.assert_allclose(found[:22, :30], 0.5, atol=1e-6)


def test_bands_of_rows_meet(tmp_path, monkeypatch):
    path = write(tmp_path / "p.png", noise(4, 70, 30))
    whole = photo.read(path)
    monkeypatch.setattr(photo, "_BAND", 16)
    for one, other in zip(photo.read(path), whole, strict=True):
        np.testing.assert_array_equal(one, other)


# Writing.


@pytest.mark.parametrize("channels", [1, 3])
def test_what_is_written_as_png_is_read_back(tmp_path, channels):
    pixels = noise(channels)
    photo.write(tmp_path / "out.png", pixels)
    found = photo.read_srgb(tmp_path / "out.png")[..., :channels]
    np.testing.assert_allclose(found, np.round(pixels * 255) / 255, atol=1e-6)


def test_half_transparent_colours_are_written_as_other_programs_read_them(tmp_path):
    """Colours come multiplied by alpha, and a PNG holds them as they are."""
    alpha = np.linspace(0, 1, 16)[:, None, None].repeat(16, axis=1)
    colours = np.array([1.0, 0.6, 0.2])
    photo.write(tmp_path / "cut.png", np.concatenate([alpha * colours, alpha], axis=-1))
    levels = np.asarray(Image.open(tmp_path / "cut.png"))
    np.testing.assert_allclose(levels[1:, :, :3] / 255, 0 * alpha[1:] + colours, atol=1 / 255)
    assert not levels[0].any()
    found, opacity = photo.read(tmp_path / "cut.png")
    np.testing.assert_allclose(found, alpha * colours, atol=1.5 / 255)
    np.testing.assert_allclose(opacity, alpha, atol=1 / 255)


def test_png_clips_and_exr_keeps_radiance(tmp_path):
    pixels = np.tile([-1, 0, 0.5, 1, 3, 60_000.0], (16, 3))[..., None]
    photo.write(tmp_path / "out.png", pixels)
    found = photo.read_srgb(tmp_path / "out.png")[0, :, 0]
    np.testing.assert_allclose(found, np.tile([0, 0, 128 / 255, 1, 1, 1], 3), atol=1e-6)
    photo.write(tmp_path / "out.exr", pixels)
    linear = oiio.ImageBuf(str(tmp_path / "out.exr")).get_pixels(oiio.FLOAT)
    np.testing.assert_allclose(linear.reshape(-1), pixels.reshape(-1), rtol=1e-3)


@pytest.mark.parametrize("suffix", ["png", "exr"])
def test_where_nothing_can_be_written_is_named(tmp_path, suffix):
    (tmp_path / "none").touch()
    path = tmp_path / "none" / f"out.{suffix}"
    with pytest.raises(OSError, match=rf"out\.{suffix} cannot be written"):
        photo.write(path, noise())


@pytest.mark.parametrize("suffix", ["png", "exr", "tif"])
def test_a_picture_is_whole_or_not_there_wherever_the_disk_ends(tmp_path, suffix):
    path, image = tmp_path / f"out.{suffix}", noise()
    photo.write(path, image)
    whole = path.read_bytes()
    for count in (0, 1, 100, len(whole) // 2, len(whole) - 100, len(whole) - 1):
        path.unlink()
        with (
            pytest.raises(OSError, match=rf"out\.{suffix} cannot be written: .*; "),
            full_disk.files_end_after(count),
        ):
            photo.write(path, image)
        assert not list(tmp_path.iterdir())
        path.write_bytes(b"earlier")
        with pytest.raises(OSError), full_disk.files_end_after(count):
            photo.write(path, image)
        assert path.read_bytes() == b"earlier" and len(list(tmp_path.iterdir())) == 1
    with full_disk.files_end_after(len(whole)):
        photo.write(path, image)
    assert path.read_bytes() == whole


def test_one_image_has_one_file_whenever_it_is_written(tmp_path):
    earlier = {}
    for path in (tmp_path / "out.png", tmp_path / "out.exr"):
        photo.write(path, noise())
        earlier[path] = path.read_bytes()
    time.sleep(1.1)  # what tells the second of its writing would differ
    for path in earlier:
        photo.write(path, noise())
        assert path.read_bytes() == earlier[path], path.suffix


def test_a_format_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"out\.txt has no suffix of a picture: call it \.png"):
        photo.write(tmp_path / "out.txt", noise())


def test_nan_is_written_as_black(tmp_path):
    photo.write(tmp_path / "out.png", np.full((16, 16, 1), np.nan))
    assert photo.read_srgb(tmp_path / "out.png").max() == 0


def test_an_encoder_that_fails_is_told_with_the_file(tmp_path, monkeypatch):
    def fail(*_, **__):
        raise OSError("codec configuration error when writing image file")

    monkeypatch.setattr("PIL.Image.Image.save", fail)
    with pytest.raises(
        OSError, match=r"a\.png cannot be written: codec .*; close programs if memory is short$"
    ):
        photo.write(tmp_path / "a.png", np.zeros((2, 2, 3), np.float32))
    assert not list(tmp_path.iterdir())
