"""Photos and masks in every form are the same photo and the same mask."""

import numpy as np
import pytest
from icc_profiles import GAMMA, profile
from PIL import Image
from written_pictures import oriented

from lime_keras.estimate.pictures import mask_of, photo_of
from lime_keras.io import photo

LEVELS = np.random.default_rng(0).integers(0, 256, (20, 30, 4), np.uint8)
FLOATS = LEVELS[..., :3] / np.float32(255)


def written(folder, image, name="photo.png", **options):
    image.save(folder / name, **options)
    return folder / name


def test_every_form_is_the_same_photo(tmp_path):
    image = Image.fromarray(LEVELS[..., :3])
    path = written(tmp_path, image)
    forms = (path, str(path), image, LEVELS[..., :3], FLOATS, FLOATS.astype(float), FLOATS.tolist())
    for form in forms:
        found, alpha, _ = photo_of(form)
        assert found.dtype == np.float32 and alpha is None
        np.testing.assert_allclose(found, FLOATS, atol=1e-7)


MODES = {
    "L": Image.fromarray(LEVELS[..., 0]),
    "1": Image.fromarray(LEVELS[..., 0] > 127),
    "P": Image.fromarray(LEVELS[..., :3]).quantize(64),
    "RGBA": Image.fromarray(LEVELS),
    "LA": Image.fromarray(LEVELS).convert("LA"),
    "opaque": Image.fromarray(np.dstack([LEVELS[..., :3], np.full((20, 30), 255, np.uint8)])),
}


@pytest.mark.parametrize("image", MODES.values(), ids=MODES)
def test_a_pil_image_is_what_its_file_is(image, tmp_path):
    found, alpha, _ = photo_of(image)
    expected, its_alpha, _ = photo_of(written(tmp_path, image))
    # Of a file with transparency, the composition over black has 8 bits.
    np.testing.assert_allclose(found, expected, atol=1e-6 if alpha is None else 0.5 / 255 + 1e-6)
    opaque = image.mode not in ("RGBA", "LA") or image is MODES["opaque"]
    assert (alpha is None) == (its_alpha is None) == opaque
    if alpha is not None:
        np.testing.assert_allclose(alpha, its_alpha, atol=1e-6)


def test_a_pil_image_is_turned_and_its_colours_converted_as_its_file_is(tmp_path):
    image = Image.fromarray(LEVELS[..., :3])
    path = written(tmp_path, image, "turned.png", exif=oriented(6), icc_profile=profile(GAMMA))
    found, _, _ = photo_of(Image.open(path))
    assert found.shape == (30, 20, 3)
    np.testing.assert_allclose(found, photo.read_srgb(path), atol=1e-6)
    turned = np.rot90(LEVELS[..., :3], -1) / 255
    assert np.abs(found - turned).max() > 0.03, "the profile was not applied"


@pytest.mark.parametrize("mode", ["I", "F", "I;16"])
def test_a_pil_image_of_unknown_range_is_refused(mode):
    with pytest.raises(ValueError, match=f"mode {mode} has no known range: pass"):
        photo_of(Image.new(mode, (20, 20)))


def test_a_pil_image_without_pixels_is_refused():
    with pytest.raises(ValueError, match="without pixels"):
        photo_of(Image.new("RGB", (0, 5)))


MASK = (np.mgrid[:20, :30][0] > 8).astype(np.float32)


def test_every_form_is_the_same_mask(tmp_path):
    levels = (MASK * 255).astype(np.uint8)
    path = written(tmp_path, Image.fromarray(levels))
    forms = (path, str(path), Image.fromarray(levels), Image.fromarray(MASK > 0), levels, MASK > 0)
    for form in (*forms, MASK, MASK[..., None], MASK.tolist(), levels[..., None]):
        found = mask_of(form, 20, 30)
        assert found.dtype == np.float32
        np.testing.assert_allclose(found[..., 0], MASK, atol=1e-7)


def test_a_cut_out_masks_by_its_transparency():
    levels = np.dstack([LEVELS[..., :3], (MASK * 255).astype(np.uint8)])
    np.testing.assert_array_equal(mask_of(Image.fromarray(levels), 20, 30)[..., 0], MASK)
    image, alpha, _ = photo_of(Image.fromarray(levels))
    np.testing.assert_array_equal(alpha[..., 0], MASK)
    np.testing.assert_allclose(image, FLOATS * alpha, atol=1e-6)


def test_zeros_and_ones_in_bytes_are_refused_with_the_remedy():
    ones = MASK.astype(np.uint8)
    for mask in (ones, Image.fromarray(ones)):
        with pytest.raises(ValueError, match=r"8 bits is 255 .* pass it as an array of bool"):
            mask_of(mask, 20, 30)
    assert mask_of(np.zeros((20, 30), np.uint8), 20, 30).max() == 0
    assert mask_of(2 * MASK.astype(np.uint8), 20, 30).max() == pytest.approx(2 / 255)


@pytest.mark.parametrize("form", [Image.new("L", (20, 30)), np.zeros((30, 20), np.uint8)])
def test_a_mask_of_another_size_is_refused(form):
    with pytest.raises(ValueError, match=r"its photo's shape, \(20, 30\).*got \(30, 20"):
        mask_of(form, 20, 30)


EIGHT = LEVELS[..., :3]


@pytest.mark.parametrize(
    "values",
    [EIGHT.astype(np.float32), EIGHT.astype(int), EIGHT.tolist(), EIGHT * 257.0, EIGHT - 1.0],
    ids=["floats", "integers", "lists", "16 bits", "negative"],
)
def test_other_ranges_are_refused_with_the_remedy(values):
    with pytest.raises(ValueError, match=r"\[0, 1\].*255.*65535.*uint8"):
        photo_of(values)
    with pytest.raises(ValueError, match=r"\[0, 1\].*255.*65535.*uint8"):
        mask_of(np.asarray(values)[..., 0], 20, 30)


@pytest.mark.parametrize("level", [0, 1, 300, 65535])
def test_sixteen_bits_are_never_guessed(level):
    values = np.full((20, 30, 3), level, np.uint16)
    for read in (lambda: photo_of(values), lambda: mask_of(values[..., 0], 20, 30)):
        with pytest.raises(ValueError, match=r"uint16 have no known range.* 16-bit ones by 65535"):
            read()
    np.testing.assert_allclose(photo_of(values / 65535)[0], level / 65535, rtol=1e-6)


@pytest.mark.parametrize(
    "values", [None, object(), EIGHT * 1j, [["a"]], [[1, 2], [3]], {"photo": 1}]
)
def test_what_is_no_picture_is_refused(values):
    for read in (photo_of, lambda given: mask_of(given, 20, 30)):
        with pytest.raises(ValueError, match="a path, a PIL image or an array of numbers, got <"):
            read(values)
