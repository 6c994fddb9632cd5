"""The square that the networks see is Python's, in JavaScript."""

import javascript
import numpy as np
import pytest

from lime_keras.estimate import framing
from lime_keras.estimate.framing import Square

SIZE = 128


def smooth(rng, height, width):
    """A photo-like picture: coarse noise, finer noise and an edge."""
    rows, columns = np.arange(height) * 5 // height, np.arange(width) * 7 // width
    coarse = rng.uniform(0, 200, (5, 7, 3))[rows[:, None], columns]
    return (coarse + rng.uniform(0, 55, (height, width, 3))).astype(np.uint8)


PICTURES = {
    "the network's size": ((128, 128), None),
    "the network's size, lying": ((128, 100), None),
    "a camera's": ((240, 320), None),
    "twice the size": ((256, 256), None),
    "an edge of two areas": ((320, 320), None),
    "upright, odd": ((301, 199), None),
    "tiny": ((1, 1), None),
    "a line": ((1, 300), None),
    "a closer view beyond the corner": ((200, 260), Square(-37, 190, 143)),
    "a much closer view": ((200, 260), Square(80, 90, 31)),
}


@pytest.mark.parametrize(("shape", "square"), PICTURES.values(), ids=PICTURES)
def test_the_cut_is_that_of_python(shape, square):
    """To 1e-4 of the range; a canvas differs by up to 0.07."""
    levels = smooth(np.random.default_rng(len(shape) + shape[0]), *shape)
    square = square or framing.whole(*shape)
    found = javascript.run(
        """
        const { cut } = await import(page + "browser/framing.js");
        const [top, left, side] = square;
        return cut({ data, width, height }, { top, left, side }, size);
        """,
        data=javascript.image(levels),
        width=shape[1],
        height=shape[0],
        square=square,
        size=SIZE,
    )
    expected = framing.cut(levels / np.float32(255), square, SIZE)
    np.testing.assert_allclose(found.reshape(SIZE, SIZE, 3), expected, atol=1e-4)


def test_areas_are_pythons_for_every_side():
    """Whether a pixel on the edge of two areas belongs to both is decided in single precision."""
    sides = [*range(129, 260), 300, 384, 480, 640, 721]
    levels = np.random.default_rng(0).integers(0, 256, (3, 721, 3), np.uint8)
    found = javascript.run(
        """
        const { cut } = await import(page + "browser/framing.js");
        const photo = { data, width: 721, height: 3 };
        return sides.map((side) => cut(photo, { top: 0, left: 0, side }, 128).slice(0, 3 * 128));
        """,
        data=javascript.image(levels),
        sides=sides,
    )
    for side, row in zip(sides, found, strict=True):
        expected = framing.cut(levels / np.float32(255), Square(0, 0, side), 128)[0]
        np.testing.assert_allclose(row.reshape(128, 3), expected, atol=1e-4, err_msg=str(side))


def test_a_given_mask_is_cut_as_in_python():
    rng = np.random.default_rng(0)
    height, width = 90, 140
    mask = np.zeros((height, width, 1), np.float32)
    mask[20:71, 100:] = rng.uniform(size=(51, 40, 1))
    found = javascript.run(
        """
        const { aroundGiven, cutLayer } = await import(page + "browser/framing.js");
        return sizes.map((size) => {
          const square = aroundGiven(mask, 90, 140);
          return [square.top, square.left, square.side, cutLayer(mask, 90, 140, square, size)];
        });
        """,
        mask=mask,
        sizes=[16, 128],
    )
    square = framing.around_mask(mask)
    for size, (*place, seen) in zip([16, 128], found, strict=True):
        assert tuple(place) == square
        expected = framing.cut_layer(mask, square, size)
        np.testing.assert_allclose(seen.reshape(size, size, 1), expected, atol=1e-6)


def test_squares_are_those_of_python():
    """Around the largest object, the first of two; with halves rounded to even; around nothing."""
    rng = np.random.default_rng(0)
    masks = (rng.uniform(size=(60, 24, 24)) < rng.uniform(0, 0.6, (60, 1, 1))).astype(np.float32)
    masks[0] = 0
    squares = [Square(*rng.integers(-50, 50, 2).tolist(), int(rng.integers(1, 500))) for _ in masks]
    found = javascript.run(
        """
        const { around, aroundGiven, insidePhoto } = await import(page + "browser/framing.js");
        return squares.map(([top, left, side], index) => {
          const mask = masks.subarray(576 * index, 576 * (index + 1));
          const near = around(mask, 24, { top, left, side });
          const given = aroundGiven(mask, 18, 32);
          const inside = insidePhoto({ top, left, side }, 200, 301, 24);
          return [near.top, near.left, near.side, given.top, given.left, given.side, inside];
        });
        """,
        masks=masks,
        squares=squares,
    )
    for mask, square, row in zip(masks, squares, found, strict=True):
        assert tuple(row[:3]) == framing.around(mask[..., None], square)
        assert tuple(row[3:6]) == framing.around_mask(mask.reshape(18, 32, 1))
        assert np.array_equal(row[6], framing.inside(square, 200, 301, 24).ravel())


def test_a_mask_covers_the_pixels_of_the_photo_that_it_does_in_python():
    """In squares smaller and larger than the mask, within the photo and beyond it."""
    rng = np.random.default_rng(0)
    mask = smooth(rng, 24, 24)[..., :1].astype(np.float32) / 255
    squares = [*(Square(5, 9, side) for side in (1, 7, 24, 61)), Square(-20, 11, 200)]
    found = javascript.run(
        """
        const { inside } = await import(page + "browser/framing.js");
        return squares.map(([top, left, side]) => inside(mask, 24, { top, left, side }, 70, 90));
        """,
        mask=mask,
        squares=squares,
    )
    for square, row in zip(squares, found, strict=True):
        pasted = framing.paste(mask, square, 70, 90)[..., 0]
        clear = np.abs(pasted - framing.THRESHOLD) > 1e-5
        expected = 255 * (pasted >= framing.THRESHOLD)
        assert np.array_equal(row.reshape(70, 90)[clear], expected[clear]), square
        assert 0 < expected.mean() < 255 or square.side == 1


@pytest.mark.parametrize("shape", [(1, 1), (5, 5), (40, 91), (300, 7)])
def test_the_whole_square_is_that_of_python(shape):
    found = javascript.run(
        'return (await import(page + "browser/framing.js")).whole(...shape);', shape=shape
    )
    assert found == framing.whole(*shape)._asdict()


def test_an_object_is_followed_as_by_python():
    """In the square where it was; not at its edge, outgrown, or gone."""
    rng, cases = np.random.default_rng(5), []
    for square in (framing.whole(480, 640), Square(40, 100, 300), Square(-10, -10, 200)):
        for _ in range(12):
            mask = np.zeros((24, 24), np.float32)
            top, left = rng.integers(0, 16, 2)
            height, width = rng.integers(1, 24, 2)
            mask[top : top + height, left : left + width] = 1
            cases.append((mask, square))
    cases.append((np.zeros((24, 24), np.float32), Square(40, 100, 300)))
    found = javascript.run(
        """
        const { following } = await import(page + "browser/framing.js");
        return squares.map(([top, left, side], at) => {
          const mask = masks.subarray(at * 24 * 24, (at + 1) * 24 * 24);
          const next = following(mask, 24, { top, left, side }, 480, 640);
          return next === null ? [0, 0, -1] : [next.top, next.left, next.side];
        });
        """,
        masks=np.concatenate([mask.ravel() for mask, _ in cases]),
        squares=[list(square) for _, square in cases],
    )
    expected = [
        framing.following(mask[..., None], square, 480, 640) or (0, 0, -1) for mask, square in cases
    ]
    assert [tuple(row) for row in found] == [tuple(row) for row in expected]
    assert len({row[2] for row in expected}) > 5 and (0, 0, -1) in expected
