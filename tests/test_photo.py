"""Pictures of every format in and out, and files that are none."""

import numpy as np
import OpenImageIO as oiio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lime_keras import colour, photo


def write(path, pixels, kind=oiio.UINT8, orientation=1):
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, kind)
    spec.attribute("Orientation", orientation)
    image = oiio.ImageBuf(spec)
    image.set_pixels(oiio.ROI(), np.ascontiguousarray(pixels, np.float32))
    assert image.write(str(path)), image.geterror()
    return path


def noise(channels=3, height=5, width=7):
    return np.random.default_rng(0).uniform(size=(height, width, channels)).astype(np.float32)


@pytest.mark.parametrize("kind, levels", [(oiio.UINT8, 255), (oiio.UINT16, 65535)])
def test_png_keeps_its_levels(tmp_path, kind, levels):
    pixels = noise()
    found = photo.read_srgb(write(tmp_path / "photo.png", pixels, kind))
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, np.round(pixels * levels) / levels, atol=1e-6)


@pytest.mark.parametrize("kind", [oiio.UINT8, oiio.UINT16])
def test_grey_is_repeated(tmp_path, kind):
    pixels = noise(1)
    found = photo.read_srgb(write(tmp_path / "grey.png", pixels, kind))
    assert found.shape == (5, 7, 3)
    np.testing.assert_allclose(found, np.repeat(pixels, 3, axis=-1), atol=0.5 / 255 + 1e-6)


def test_alpha_is_dropped(tmp_path):
    pixels = np.concatenate([noise(), np.ones((5, 7, 1))], axis=-1)
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
    found = photo.read_srgb(write(tmp_path / "grey.exr", np.full((2, 3, 1), 0.25), oiio.HALF))
    np.testing.assert_allclose(found, 0.5370987, atol=1e-3)


def test_photographs_are_turned_upright(tmp_path):
    pixels = np.zeros((4, 6, 3))
    pixels[:, :3] = 1
    found = photo.read_srgb(write(tmp_path / "turned.jpg", pixels, orientation=6))
    assert found.shape == (6, 4, 3)
    assert found[:2].min() > 0.8 and found[-2:].max() < 0.2


@pytest.mark.parametrize("shape", [(1, 1), (1, 300), (300, 1)])
def test_pictures_of_every_shape(tmp_path, shape):
    assert photo.read_srgb(write(tmp_path / "p.png", noise(3, *shape))).shape == (*shape, 3)


def refused(path, reason="cannot be read as a picture"):
    with pytest.raises(ValueError, match=rf"{path.name} {reason}"):
        photo.read_srgb(path)


@pytest.mark.parametrize("name", ["none.png", "none.exr", "none.txt", "none"])
def test_a_missing_file_is_named(name, tmp_path):
    refused(tmp_path / name)


@pytest.mark.parametrize("name", ["folder", "folder.png", "folder.exr"])
def test_a_folder_is_named(name, tmp_path):
    (tmp_path / name).mkdir()
    refused(tmp_path / name)


@pytest.mark.parametrize("name", ["broken.png", "broken.jpg", "broken.exr", "broken.txt"])
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


# Writing.


@pytest.mark.parametrize("channels", [1, 3])
def test_what_is_written_as_png_is_read_back(tmp_path, channels):
    pixels = noise(channels)
    photo.write(tmp_path / "out.png", pixels)
    found = photo.read_srgb(tmp_path / "out.png")[..., :channels]
    np.testing.assert_allclose(found, np.round(pixels * 255) / 255, atol=1e-6)


def test_png_clips_and_exr_keeps_radiance(tmp_path):
    pixels = np.array([-1, 0, 0.5, 1, 3, 60_000.0]).reshape(1, 6, 1)
    photo.write(tmp_path / "out.png", pixels)
    found = photo.read_srgb(tmp_path / "out.png")[0, :, 0]
    np.testing.assert_allclose(found, [0, 0, 128 / 255, 1, 1, 1], atol=1e-6)
    photo.write(tmp_path / "out.exr", pixels)
    linear = oiio.ImageBuf(str(tmp_path / "out.exr")).get_pixels(oiio.FLOAT)
    np.testing.assert_allclose(linear.reshape(-1), pixels.reshape(-1), rtol=1e-3)


@pytest.mark.parametrize("suffix", ["png", "exr"])
def test_where_nothing_can_be_written_is_named(tmp_path, suffix):
    path = tmp_path / "none" / f"out.{suffix}"
    with pytest.raises(OSError, match=rf"out\.{suffix} cannot be written"):
        photo.write(path, noise())


# Fitting into a square.


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 60), st.integers(1, 60), st.sampled_from([1, 16, 32]), st.integers(0, 99))
def test_fitting_keeps_the_range(height, width, size, seed):
    image = np.random.default_rng(seed).choice([0.0, 0.3, 1.0], (height, width, 3))
    found = photo.fit_square(image.astype(np.float32), size)
    assert found.shape == (size, size, 3) and found.dtype == np.float32
    assert found.min() >= image.min() and found.max() <= np.float32(image.max())


@pytest.mark.parametrize("shape", [(32, 32), (20, 32), (32, 7), (31, 32)])
def test_what_fits_is_centred_and_not_resampled(shape):
    image = noise(3, *shape)
    found = photo.fit_square(image, 32)
    top, left = (32 - shape[0]) // 2, (32 - shape[1]) // 2
    np.testing.assert_array_equal(found[top : top + shape[0], left : left + shape[1]], image)
    np.testing.assert_array_equal(found[0], found[top])
    np.testing.assert_array_equal(found[:, -1], found[:, left + shape[1] - 1])


@pytest.mark.parametrize("shape", [(64, 64), (40, 90), (90, 11), (1, 1), (3, 300)])
def test_a_constant_stays_constant(shape):
    np.testing.assert_allclose(photo.fit_square(np.full((*shape, 3), 0.3, np.float32), 32), 0.3)


def test_the_aspect_is_kept():
    """A square in the middle of a wide photo is still a square, and in the middle."""
    image = np.zeros((128, 256, 3), np.float32)
    image[48:80, 112:144] = 1
    found = photo.fit_square(image, 64)[..., 0]
    rows, columns = np.nonzero(found > 0.5)
    assert (rows.min(), rows.max()) == (columns.min(), columns.max()) == (28, 35)


def test_shrinking_averages():
    image = np.indices((128, 128)).sum(0)[..., None] % 2 * np.ones(3, np.float32)
    found = photo.fit_square(image.astype(np.float32), 16)
    np.testing.assert_allclose(found, colour.linear_to_srgb(0.5), atol=1e-3)


@pytest.mark.parametrize("factor", [2, 4])
def test_photos_are_made_smaller_as_training_images_are(factor):
    from sphere_corpus import example

    from lime_keras import pipeline, records

    record = records.parse(records.encode(example(0)))
    size = record["image"].shape[0] // factor
    expected = pipeline.resize(record, size)["image"]
    np.testing.assert_allclose(photo.fit_square(record["image"].numpy(), size), expected, atol=2e-5)
