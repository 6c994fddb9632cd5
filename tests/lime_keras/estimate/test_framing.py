"""Squares of photos: found, cut out and brought back."""

import numpy as np
import OpenImageIO as oiio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from lime_keras.estimate import framing
from lime_keras.estimate.framing import Square
from lime_keras.optics import colour


def noise(channels=3, height=5, width=7):
    return np.random.default_rng(0).uniform(size=(height, width, channels)).astype(np.float32)


def fitted(image, size):
    return framing.cut(image, framing.whole(*image.shape[:2]), size)


@pytest.mark.parametrize(("height", "width"), [(40, 3), (3, 40), (31, 40)])
@pytest.mark.parametrize("part", [1, 100, framing._PART])
def test_a_square_that_is_averaged_by_parts_is_that_of_the_whole(height, width, part, monkeypatch):
    """To the last bit, for a photo, whose edge is repeated, and a layer, which is 0 beyond."""
    image, square = noise(3, height, width), framing.whole(height, width)
    (top, left, side), size = square, 16
    below, right = side - height + top, side - width + left
    beyond = ((-top, below), (-left, right), (0, 0))
    monkeypatch.setattr(framing, "_PART", part)
    layer = framing.cut_layer(image, square, size)
    padded = framing._averaged(framing._averaged(np.pad(image, beyond), size, 0), size, 1)
    assert np.array_equal(layer, padded)
    linear = np.pad(colour.srgb_to_linear(image), beyond, mode="edge")
    averaged = framing._averaged(framing._averaged(linear, size, 0), size, 1)
    expected = np.clip(colour.linear_to_srgb(averaged), image.min(), image.max())
    assert np.array_equal(framing.cut(image, square, size), expected)


# Finding the square.


def disc(height, width, row, column, radius):
    """Mask `(H, W, 1)` of a disc."""
    rows, columns = np.mgrid[:height, :width] + 0.5
    inside = (rows - row) ** 2 + (columns - column) ** 2 <= radius**2
    return inside[..., None].astype(np.float32)


@pytest.mark.parametrize("height, width", [(1, 1), (5, 5), (40, 91), (300, 7)])
def test_the_whole_square_holds_the_photo_in_its_middle(height, width):
    square = framing.whole(height, width)
    assert square.side == max(height, width)
    below, right = square.top + square.side - height, square.left + square.side - width
    assert 0 <= below - -square.top <= 1 and 0 <= right - -square.left <= 1


def test_a_small_object_is_looked_at_from_near():
    """A disc a tenth as wide as the photo comes to fill `FILL` of the new square's middle."""
    whole = framing.whole(600, 1000)
    mask = framing.cut_layer(disc(600, 1000, 150, 800, 50), whole, 128)
    square = framing.around(mask, whole)
    assert square.side == pytest.approx(100 / framing.FILL, rel=0.1)
    assert square.top + square.side / 2 == pytest.approx(150, abs=8)
    assert square.left + square.side / 2 == pytest.approx(800, abs=8)
    near = framing.cut_layer(disc(600, 1000, 150, 800, 50), square, 128)
    assert framing.around(near, square) == square


@pytest.mark.parametrize("radius", [32, 45, 64, 90])
def test_a_large_object_is_left_as_it_is(radius):
    square = Square(0, 0, 128)
    assert framing.around(disc(128, 128, 64, 64, radius), square) == square


def test_the_largest_object_is_the_one_that_scipy_finds():
    """Of objects that touch at corners alone, too, and of the first of two of one size."""
    rng, near = np.random.default_rng(0), 0
    for _ in range(200):
        mask = (rng.uniform(size=(24, 24, 1)) < rng.uniform(0, 0.6)).astype(np.float32)
        labels, count = ndimage.label(mask[..., 0])
        found = framing.around(mask, Square(0, 0, 240))
        if not count:
            assert found == (0, 0, 240)
            continue
        rows, columns = ndimage.find_objects(labels)[np.argmax(np.bincount(labels.flat)[1:])]
        extent = max(rows.stop - rows.start, columns.stop - columns.start)
        near += extent < 12
        if extent >= 12:
            assert found == (0, 0, 240)
            continue
        assert found.side == round(extent * 10 / framing.FILL)
        assert found.top == round(5 * (rows.start + rows.stop) - found.side / 2)
        assert found.left == round(5 * (columns.start + columns.stop) - found.side / 2)
    assert 50 < near < 200


def test_the_square_around_a_given_mask_holds_all_of_it():
    rng = np.random.default_rng(1)
    for _ in range(100):
        mask = (rng.uniform(size=(30, 50, 1)) < rng.uniform(0.001, 0.02)).astype(np.float32)
        if not mask.any():
            continue
        rows, columns = ndimage.find_objects(mask[..., 0].astype(int))[0]
        extent = max(rows.stop - rows.start, columns.stop - columns.start)
        square = framing.around_mask(mask)
        assert square.side == max(1, round(extent / framing.FILL))
        assert square.top == round((rows.start + rows.stop) / 2 - square.side / 2)
        assert square.left == round((columns.start + columns.stop) / 2 - square.side / 2)


def test_an_object_of_less_than_a_pixel_has_a_square_of_one():
    """In a photo of 16 pixels, one of the networks' 128 is an eighth of its pixel."""
    mask = np.zeros((128, 128, 1), np.float32)
    mask[40, 80] = 1
    assert framing.around(mask, Square(0, 0, 16)) == Square(5, 10, 1)


@pytest.mark.parametrize("value", [0.0, 0.49])
def test_where_nothing_is_found_the_square_stays(value):
    square = Square(-3, 5, 40)
    assert framing.around(np.full((32, 32, 1), value), square) == square
    assert framing.around_mask(np.full((30, 50, 1), value)) == framing.whole(30, 50)


@pytest.mark.parametrize("row, column", [(0, 0), (31, 31), (7, 20)])
def test_one_pixel_is_an_object(row, column):
    mask = np.zeros((32, 32, 1))
    mask[row, column] = 1
    square = framing.around(mask, Square(0, 0, 320))
    assert square.side == round(10 / framing.FILL)
    assert square.top <= 10 * row and square.top + square.side >= 10 * row + 10
    given = framing.around_mask(mask)
    assert given.side == 1 and (given.top, given.left) == (row, column)


# There and back.


@settings(max_examples=60)
@given(st.integers(-50, 50), st.integers(-50, 50), st.integers(1, 80), st.sampled_from([1, 16, 32]))
def test_any_square_can_be_cut_and_pasted(top, left, side, size):
    square, image = Square(top, left, side), noise(3, 20, 30)
    found = framing.cut(image, square, size)
    assert found.shape == (size, size, 3)
    assert found.min() >= image.min() and found.max() <= image.max()
    mask = framing.cut_layer(np.ones((20, 30, 1)), square, size)
    assert mask.shape == (size, size, 1) and mask.min() >= 0 and mask.max() <= 1 + 1e-6
    back = framing.paste(found, square, 20, 30)
    assert back.shape == (20, 30, 3) and back.dtype == np.float32
    rows, columns = np.mgrid[:20, :30]
    inside = (rows >= top) & (rows < top + side) & (columns >= left) & (columns < left + side)
    assert (back[~inside] == 0).all()
    assert ((back[inside] > 0) | (found.min() == 0)).all()


@pytest.mark.parametrize("square", [Square(4, 6, 16), Square(-8, -8, 32), Square(10, 20, 64)])
def test_what_is_pasted_lies_where_it_was_cut(square):
    """A smooth picture comes back over its own place; at the rim, half a pixel of the layer's."""
    rows, columns = np.mgrid[:60, :90]
    image = np.stack([rows / 60, columns / 90, (rows + columns) / 150], axis=-1).astype(np.float32)
    back = framing.paste(framing.cut(image, square, 16), square, 60, 90)
    inside = np.zeros((60, 90), bool)
    edge = square.side // 16 + 1
    inside[
        max(square.top, 0) + edge : square.top + square.side - edge,
        max(square.left, 0) + edge : square.left + square.side - edge,
    ] = True
    np.testing.assert_allclose(back[inside], image[inside], atol=0.04)


def test_a_mask_is_averaged_and_ends_with_the_photo():
    found = framing.cut_layer(np.ones((40, 40, 1)), Square(-20, 0, 40), 20)[..., 0]
    np.testing.assert_array_equal(found[:10], 0)
    np.testing.assert_array_equal(found[10:], 1)


# Cutting out all of it.


@settings(max_examples=40)
@given(st.integers(1, 60), st.integers(1, 60), st.sampled_from([1, 16, 32]), st.integers(0, 99))
def test_fitting_keeps_the_range(height, width, size, seed):
    image = np.random.default_rng(seed).choice([0.0, 0.3, 1.0], (height, width, 3))
    found = fitted(image.astype(np.float32), size)
    assert found.shape == (size, size, 3) and found.dtype == np.float32
    assert found.min() >= image.min() and found.max() <= np.float32(image.max())


@pytest.mark.parametrize("shape", [(32, 32), (20, 32), (32, 7), (31, 32)])
def test_what_fits_is_centred_and_not_resampled(shape):
    image = noise(3, *shape)
    found = fitted(image, 32)
    top, left = (32 - shape[0]) // 2, (32 - shape[1]) // 2
    np.testing.assert_array_equal(found[top : top + shape[0], left : left + shape[1]], image)
    np.testing.assert_array_equal(found[0], found[top])
    np.testing.assert_array_equal(found[:, -1], found[:, left + shape[1] - 1])


@pytest.mark.parametrize("shape", [(64, 64), (40, 90), (90, 11), (1, 1), (3, 300)])
def test_a_constant_stays_constant(shape):
    np.testing.assert_allclose(fitted(np.full((*shape, 3), 0.3, np.float32), 32), 0.3)


def test_the_aspect_is_kept():
    """A square in the middle of a wide photo is still a square, and in the middle."""
    image = np.zeros((128, 256, 3), np.float32)
    image[48:80, 112:144] = 1
    found = fitted(image, 64)[..., 0]
    rows, columns = np.nonzero(found > 0.5)
    assert (rows.min(), rows.max()) == (columns.min(), columns.max()) == (28, 35)


@pytest.mark.parametrize("factor", [2, 4])
def test_photos_are_made_smaller_as_training_images_are(factor):
    from sphere_corpus import example

    from lime_keras.data import pipeline, records

    record = records.parse(records.encode(example(0)))
    size = record["image"].shape[0] // factor
    expected = pipeline.resize(record, size)["image"]
    np.testing.assert_allclose(fitted(record["image"].numpy(), size), expected, atol=2e-5)


def test_samples_inside_the_photo_are_those_whose_middle_is():
    found = framing.inside(framing.Square(-4, 2, 8), 10, 7, 4)
    assert found.shape == (4, 4, 1)
    # Rows' middles at −3, −1, 1, 3; columns' at 3, 5, 7, 9.
    assert found[..., 0].tolist() == [[False] * 4] * 2 + [[True, True, True, False]] * 2


@pytest.mark.parametrize("size", [16, 128])
def test_areas_are_those_of_openimageio(size):
    """Single precision decides to which area a pixel on an edge belongs, as it does there."""
    for side in (*range(size + 1, size + 140), 480, 640, 1000):
        row = np.random.default_rng(side).uniform(size=(side, side, 1)).astype(np.float32)
        region = oiio.ROI(0, size, 0, size, 0, 1, 0, 1)
        resized = oiio.ImageBufAlgo.resize(oiio.ImageBuf(row), filtername="box", roi=region)
        expected = np.asarray(resized.get_pixels(oiio.FLOAT)).reshape(size, size, 1)
        found = framing.cut_layer(row, Square(0, 0, side), size)
        np.testing.assert_allclose(found, expected, atol=2e-6, err_msg=str(side))


# A stream's next frame.

FRAME = (480, 640)
WHOLE = framing.whole(*FRAME)
BOX = (10, 22)


def shown(rows, columns, size=32):
    """A mask of one rectangle."""
    mask = np.zeros((size, size, 1), np.float32)
    mask[slice(*rows), slice(*columns)] = 1
    return mask


def test_the_next_square_is_around_the_object():
    top, left, side = framing.following(shown(BOX, (6, 18)), Square(100, 200, 128), *FRAME)
    # 12 of 32 pixels, each 4 of the frame's.
    assert side == pytest.approx(48 / framing.FILL, abs=1)
    assert (top + side / 2, left + side / 2) == pytest.approx((164, 248), abs=1)


@pytest.mark.parametrize(
    ("columns", "left", "is_lost"),
    [((0, 12), 200, True), ((0, 12), 0, False), ((20, 32), 511, True), ((20, 32), 512, False)],
)
def test_an_object_at_the_edge_is_lost_where_the_frame_goes_on(columns, left, is_lost):
    square = framing.following(shown(BOX, columns), Square(100, left, 128), *FRAME)
    assert (square is None) == is_lost


@pytest.mark.parametrize(("box", "is_lost"), [((2, 30), False), ((1, 31), True)])
def test_an_object_that_outgrows_its_square_is_lost(box, is_lost):
    """From the whole frame it cannot."""
    mask = shown(box, box)
    assert (framing.following(mask, Square(100, 200, 128), *FRAME) is None) == is_lost
    assert framing.following(mask, WHOLE, *FRAME) == WHOLE


def test_without_an_object_there_is_no_next_square():
    assert framing.following(np.zeros((32, 32, 1)), Square(100, 200, 128), *FRAME) is None
