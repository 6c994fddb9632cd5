"""The mask's confidence, and what is told of photos that are hard to estimate."""

import numpy as np
import pytest

from lime_keras.estimate import cautions
from lime_keras.optics import colour, dichromatic

SIZE = 200


def box(top, left, bottom, right, coverage=1.0, shape=(SIZE, SIZE)):
    mask = np.zeros((*shape, 1), np.float32)
    mask[top:bottom, left:right] = coverage
    return mask


GOOD = box(50, 40, 150, 160)
TINT = np.array([1, 0.9, 0.8], np.float32)


def plain(level, shape=(SIZE, SIZE)):
    """Return a picture of one colour, which is nearly grey."""
    return np.broadcast_to(np.float32(level) * TINT, (*shape, 3)).copy()


PLAIN = plain(0.8)


def codes(mask=GOOD, image=PLAIN, confidence=1.0):
    return [caution.code for caution in cautions.of(image, mask, confidence)]


def test_a_mask_of_zeros_and_ones_is_certain():
    assert cautions.confidence(GOOD) == 1
    assert cautions.confidence(np.ones((1, 1, 1), np.float32)) == 1
    assert cautions.confidence(np.full((8, 8, 1), 0.5, np.float32)) == 0.5


@pytest.mark.parametrize("coverage", [0.0, 1e-30, np.nextafter(np.float32(0.5), np.float32(0))])
def test_a_mask_without_an_object_has_no_confidence(coverage):
    assert cautions.confidence(np.full((8, 8, 1), coverage, np.float32)) is None


@pytest.mark.parametrize("doubt", [0.02, 0.2, 0.45])
def test_the_confidence_is_the_iou_that_is_expected(doubt):
    """Against masks drawn from the coverage as probabilities; large, so that the means meet."""
    draw = np.random.default_rng(0)
    mask = np.clip(np.abs(GOOD - doubt * draw.uniform(size=GOOD.shape)), 0, 1).astype(np.float32)
    cut = mask >= 0.5
    ious = []
    for _ in range(20):
        true = draw.uniform(size=mask.shape) < mask
        ious.append(np.sum(cut & true) / np.sum(cut | true))
    assert cautions.confidence(mask) == pytest.approx(np.mean(ious), abs=0.004)


def test_the_confidence_of_many_pixels_is_summed_in_full():
    mask = np.full((3000, 2000, 1), 0.9, np.float32)
    assert cautions.confidence(mask) == pytest.approx(0.9, rel=1e-6)


def test_a_good_photo_is_not_doubted():
    assert codes() == []
    assert codes(confidence=None) == []


@pytest.mark.parametrize("coverage", [0.0, 0.49])
def test_no_object_is_all_that_is_told_of_a_photo_that_shows_something(coverage):
    assert cautions.of(PLAIN, coverage * GOOD, None) == (cautions.NO_OBJECT,)
    assert cautions.of(np.ones_like(PLAIN), coverage * GOOD, 0.1) == (cautions.NO_OBJECT,)


def test_a_photo_that_is_black_all_over_is_told_as_the_reason_for_no_object():
    lamp = np.zeros_like(PLAIN)
    assert codes(0 * GOOD, lamp) == ["no-object", "too-dark"]
    assert "the photo is nearly black" in cautions.of(lamp, 0 * GOOD, None)[1].message
    lamp[:3] = 1
    assert codes(0 * GOOD, lamp) == ["no-object"]


DOUBTED = {
    "uncertain-mask": {"confidence": 0.899},
    "small-object": {"mask": box(80, 80, 102, 150)},
    "few-pixels": {"mask": box(80, 80, 143, 143)},
    "touches-frame": {"mask": box(50, 40, 200, 160)},
    "many-parts": {"mask": GOOD + box(0, 30, 40, 100)},
    "too-dark": {"image": plain(0.2)},
    "underexposed": {"image": plain(0.6)},
    "clipped": {"image": np.where(np.arange(SIZE)[:, None, None] < 70, 1, PLAIN)},
    "burnt-highlight": {"image": np.where(np.arange(SIZE)[:, None, None] < 52, 1, PLAIN)},
    "grey": {"image": np.full_like(PLAIN, 0.8)},
    "second-colour": {"image": np.where(np.arange(SIZE)[:, None] < 100, PLAIN, PLAIN[..., ::-1])},
}


@pytest.mark.parametrize("code", DOUBTED)
def test_each_doubt_is_told_with_its_mend(code):
    assert code in codes(**DOUBTED[code])
    given = {"image": PLAIN, "mask": GOOD, "confidence": 1.0} | DOUBTED[code]
    told = cautions.of(given["image"], given["mask"], given["confidence"])
    message = {caution.code: caution.message for caution in told}[code]
    assert any(mend in message for mend in ("pass a", "take a photo", "expose the photo"))
    assert not message[0].isupper() and not message.endswith(".")


BARELY = {
    "uncertain-mask": {"confidence": 0.925},
    "small-object": {"mask": box(80, 60, 101, 140)},
    "few-pixels": {"mask": box(80, 80, 144, 144)},
    "touches-frame": {"mask": box(50, 40, 197, 160)},
    "many-parts": {"mask": GOOD + box(20, 30, 40, 90)},
    "too-dark": {"image": np.where(np.arange(SIZE)[:, None, None] < 5, 1, plain(0.29))},
    "underexposed": {"image": plain(170 / 255)},
    "clipped": {"image": np.where(np.arange(SIZE)[:, None, None] < 51, 1, PLAIN)},
    "grey": {"image": np.full_like(PLAIN, 0.8) + np.array([0, 1.5, 3], np.float32) / 255},
}


@pytest.mark.parametrize("code", BARELY)
def test_up_to_the_limit_nothing_is_told(code):
    assert codes(**BARELY[code]) == []


def test_a_given_mask_is_not_doubted_for_being_small():
    assert codes(box(80, 80, 102, 150), confidence=None) == []


def test_a_tip_may_reach_the_frame():
    assert codes(GOOD + box(0, 100, 60, 107)) == []
    assert codes(GOOD + box(0, 100, 60, 110)) == ["touches-frame"]


@pytest.mark.parametrize("side", range(4))
def test_every_side_is_looked_at(side):
    mask = np.rot90(box(20, 0, 100, 100), side)
    assert codes(mask) == ["touches-frame"]


@pytest.mark.parametrize(("size", "near"), [(200, 3), (800, 7)])
def test_the_frame_is_as_thick_as_a_pixel_that_the_networks_see(size, near):
    image, half = plain(0.8, (size, size)), size // 2
    for top, told in ((near - 1, ["touches-frame"]), (near, [])):
        mask = box(top, size // 4, half, half, shape=(size, size))
        assert codes(mask, image) == told


def test_only_the_object_is_judged_by_its_brightness():
    for outside in (0.0, 1.0):
        assert codes(image=np.where(GOOD > 0, PLAIN, np.float32(outside))) == []


def test_a_colour_that_is_clipped_in_one_channel_is_no_white():
    one = np.where(np.arange(3) == 0, np.float32(1), PLAIN)
    assert codes(image=np.where(np.arange(SIZE)[:, None, None] < 70, one, PLAIN)) == []
    levels = np.round(PLAIN * 0 + 254) / np.float32(255)
    assert codes(image=levels) == ["clipped", "grey"]


def test_many_pixels_are_judged_as_few():
    """By every so many of them: the share of white stays."""
    image = plain(0.5, (900, 900))
    image[300:420, 300:600] = 1
    mask = box(200, 200, 700, 700, shape=(900, 900))
    clipped = 120 * 300 / 500**2
    assert clipped < cautions.CLIPPED and codes(mask, image) == ["burnt-highlight"]
    image[300:450, 300:600] = 1
    assert codes(mask, image) == ["clipped"]


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (500, 1), (16, 16)])
def test_photos_of_every_shape_are_judged(shape):
    told = codes(np.ones((*shape, 1), np.float32), plain(0.5, shape))
    assert "touches-frame" in told and "no-object" not in told


def test_the_darkest_is_a_luminance():
    """Ten shares of the object, nine of which are black."""
    limit = colour.linear_to_srgb(cautions.DARKEST)
    for factor, told in ((0.9, ["too-dark"]), (1.1, [])):
        columns = np.arange(SIZE)[:, None] % 2 > 0
        image = np.where(columns, np.float32(limit * factor), np.float32(0))
        image[:5] = 1  # beside the object, so that the photo is well exposed
        grey = np.broadcast_to(image[..., None], PLAIN.shape)
        assert codes(image=grey) == [*told, "grey"]


def lit(albedo, light, exponent=60.0):
    """Return a ball of a colour under a lamp of a colour, m_s 0.3, sRGB, and its mask."""
    y, x = np.mgrid[:SIZE, :SIZE] / (SIZE / 2) - 1
    inside = x**2 + y**2 < 0.8
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    diffuse, shine = np.maximum(0.6 * z - 0.5 * x - 0.62 * y, 0.02), (0.9 * z - 0.3 * (x + y))
    radiance = (
        np.multiply.outer(diffuse, albedo) + 0.3 * np.maximum(shine, 0)[..., None] ** exponent
    )
    srgb = colour.linear_to_srgb(np.clip(radiance * light, 0, 1)) * inside[..., None]
    return srgb.astype(np.float32), inside[..., None].astype(np.float32)


@pytest.mark.parametrize("albedo", [(0.6, 0.3, 0.1), (0.1, 0.2, 0.6), (0.4, 0.38, 0.4)])
def test_one_colour_under_grey_light_has_no_second(albedo):
    image, mask = lit(albedo, (1.0, 1.0, 1.0))
    levels = np.rint(255 * image) / np.float32(255)
    assert dichromatic.second_colour(levels[mask[..., 0] > 0]) < 0.02
    assert not {"grey", "second-colour"} & set(codes(mask, levels))


def test_a_highlight_in_the_colour_of_its_light_is_a_second_colour():
    image, mask = lit((0.1, 0.2, 0.6), (1.0, 0.7, 0.2))
    assert "second-colour" in codes(mask, image)


def test_white_pixels_and_black_ones_have_no_colour():
    for pixels in (np.ones((9, 3)), np.zeros((9, 3)), np.empty((0, 3))):
        assert dichromatic.second_colour(np.array(pixels, np.float32)) == 0


@pytest.mark.parametrize("shape", [(600, 400), (500, 500), (400, 300)])
def test_a_photo_is_judged_by_all_of_its_columns(shape):
    """A stride that shares a factor with the width would see few of them."""
    image = np.zeros((10 * shape[0], 10 * shape[1], 3), np.uint8)
    image[:, 10 * shape[1] // 2 :][:, :20] = 255  # a bright strip in a cut-out
    seen = cautions._thinned(image.reshape(-1, 3), image.shape[1])
    assert 0.9 * cautions._JUDGED < len(seen) < 1.1 * cautions._JUDGED
    assert np.mean(seen[:, 0] > 0) == pytest.approx(20 / image.shape[1], rel=0.2)
    assert cautions.bright_share(image) == 1
