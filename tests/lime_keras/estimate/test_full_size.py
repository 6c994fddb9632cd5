"""Guided upsampling: exact where it must be, within the layer's range everywhere."""

import numpy as np
import pytest

from lime_keras.estimate import framing, full_size
from lime_keras.estimate.framing import Square

SIZE, SIDE = 16, 128
WHOLE = Square(0, 0, SIDE)


def reduced(image):
    step = SIDE // SIZE
    return image.reshape(SIZE, step, SIZE, step, -1).mean((1, 3)).astype(np.float32)


@pytest.fixture
def disc():
    """The mask of a disc, and a photo of it: one colour before another."""
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5
    inside = np.clip(40.3 - np.hypot(x - 61, y - 66), 0, 1)[..., None].astype(np.float32)
    photo = inside * np.float32([0.9, 0.6, 0.2]) + (1 - inside) * np.float32([0.1, 0.1, 0.4])
    return inside, photo


def noise(seed=0, shape=(SIDE, SIDE, 3)):
    return np.random.default_rng(seed).uniform(size=shape).astype(np.float32)


def upsampled(photo, mask, square=WHOLE):
    """The mask in the photo's pixels; what the networks see is the mean over areas."""
    return full_size.mask(photo, square, reduced(photo), mask)


def test_the_mask_of_one_colour_before_another_is_the_photos(disc):
    mask, photo = disc
    found = upsampled(photo, reduced(mask))
    interpolated = framing.paste(reduced(mask), WHOLE, SIDE, SIDE)
    assert np.abs(found - mask).max() < 0.02
    assert np.abs(found - mask).mean() < np.abs(interpolated - mask).mean() / 50


def test_a_photo_without_detail_leaves_the_layer_interpolated(disc):
    mask, _ = disc
    low = reduced(mask)
    grey = np.full((SIDE, SIDE, 3), 0.5, np.float32)
    expected = framing.paste(low, WHOLE, SIDE, SIDE)
    np.testing.assert_allclose(upsampled(grey, low), expected, atol=1e-6)
    shading = 3 * np.ones_like(low)
    found = full_size.radiance(grey, WHOLE, reduced(grey), np.ones_like(low), shading, mask)
    np.testing.assert_allclose(found, np.expm1(np.log(4) * mask), rtol=1e-5)


@pytest.mark.parametrize("value", [0.0, 1.0])
def test_texture_stays_out_of_where_the_mask_has_no_edge(value):
    low = np.full((SIZE, SIZE, 1), value, np.float32)
    np.testing.assert_allclose(upsampled(noise(), low), value, atol=1e-6)


def test_no_value_leaves_the_range_of_its_surroundings(disc):
    low = reduced(disc[0])
    low[8, 8] = 0.4
    found = upsampled(noise(1), low)
    least, most = (framing.paste(edge, WHOLE, SIDE, SIDE) for edge in surroundings(low))
    assert np.all((found >= least - 1e-6) & (found <= most + 1e-6))
    assert not np.allclose(found, framing.paste(low, WHOLE, SIDE, SIDE), atol=0.05)


def surroundings(low):
    """The least and the largest value of 3 × 3 pixels, one after the other."""
    both = np.empty((2, *low.shape), np.float32)
    for row, column in np.ndindex(*low.shape[:2]):
        window = low[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
        both[:, row, column, 0] = window.min(), window.max()
    return both


def test_radiance_ends_with_the_mask_and_does_not_fade_before(disc):
    mask, photo = disc
    low = reduced(mask)
    shading = np.expm1(np.log1p(5.0) * low).astype(np.float32)
    found = full_size.radiance(photo, WHOLE, reduced(photo), low, shading, mask)
    assert found.dtype == np.float32 and not found[mask == 0].any()
    np.testing.assert_allclose(found[mask == 1], 5, rtol=1e-4)


def test_bright_and_dark_radiance_stays_finite(disc):
    mask, photo = disc
    low = reduced(mask)
    for shading in (np.zeros_like(low), 5e4 * (low >= 1), 1e-8 * low):
        shading = shading.astype(np.float32)
        found = full_size.radiance(photo, WHOLE, reduced(photo), low, shading, mask)
        assert np.all((found >= 0) & (found <= shading.max() * 1.001))


def test_no_object_has_no_radiance():
    nothing = np.zeros((SIZE, SIZE, 1), np.float32)
    photo = noise()
    arguments = photo, WHOLE, reduced(photo), nothing, nothing
    assert not full_size.radiance(*arguments, np.zeros((SIDE, SIDE, 1))).any()
    assert not full_size.radiance(*arguments, np.ones((SIDE, SIDE, 1))).any()


@pytest.mark.parametrize(
    "square",
    [Square(-30, -10, 190), Square(40, -20, 77), Square(50, 60, 9), Square(-3, 100, 20)],
    ids=["beyond", "left", "finer", "right"],
)
def test_parts_make_the_whole_wherever_the_square_lies(square, monkeypatch):
    photo, low = noise(2, (100, 120, 3)), noise(3, (SIZE, SIZE, 1))
    seen = framing.cut(photo, square, SIZE)
    found = full_size.mask(photo, square, seen, low)
    monkeypatch.setattr(full_size, "_TILE", 7)
    parts = full_size.mask(photo, square, seen, low)
    np.testing.assert_allclose(parts, found, atol=1e-5)
    assert np.array_equal(found > 0, framing.paste(low, square, 100, 120) > 0)


def test_the_slopes_are_those_of_least_squares():
    seen, layer = noise(4, (SIZE, SIZE, 3)), noise(5, (SIZE, SIZE, 1))
    found = full_size._slopes(seen, layer, np.ones_like(layer), 0.1)
    for row, column in ((7, 9), (0, 0), (15, 3)):
        window = slice(max(row - 1, 0), row + 2), slice(max(column - 1, 0), column + 2)
        colours, values = seen[window].reshape(-1, 3), layer[window].reshape(-1)
        centred = colours - colours.mean(0)
        ridge = np.vstack([centred, np.sqrt(len(values)) * 0.1 * np.eye(3)])
        expected = np.linalg.lstsq(ridge, [*values - values.mean(), 0, 0, 0])[0]
        np.testing.assert_allclose(found[row, column], expected, rtol=1e-4)
