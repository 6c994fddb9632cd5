"""Cuts are told, and what is no cut is not."""

import numpy as np
import pytest

from lime_keras.video.cuts import CutDetector, distance, histogram

SIZE = (96, 128)


def picture(seed, width=SIZE[1]):
    """A room of blurred, coloured patches, `(96, width, 3)` floats of 0 to 255."""
    rng = np.random.default_rng(seed)
    cells = rng.uniform(0, 255, (12, width // 8, 3)) * 0.3 + rng.uniform(20, 180, 3)
    image = np.kron(cells, np.ones((8, 8, 1)))
    for axis in (0, 1):
        image = sum(np.roll(image, shift, axis) for shift in range(-4, 5)) / 9
    return image


def cuts(images):
    """Numbers of the frames that are told to begin a scene."""
    detector = CutDetector()
    frames = [np.uint8(np.clip(np.rint(image), 0, 255)) for image in images]
    return [number for number, frame in enumerate(frames) if detector.is_cut(frame)]


def noisy(image, count, seed=0, deviation=4.0):
    return image + np.random.default_rng(seed).normal(0, deviation, (count, *image.shape))


def with_object(image, column, level):
    """A disc of one level across the picture's middle."""
    row, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    inside = np.hypot(row - 48, columns - column) < 25
    return np.where(inside[..., None], level, image)


STILL, OTHER = picture(0), picture(1)
CALM = {
    "one frame": [STILL],
    "a still picture": [STILL] * 5,
    "a camera's noise": noisy(STILL, 20, deviation=12.0),
    "an object passing by": [with_object(STILL, c, (220, 30, 20)) for c in range(-30, 160, 6)],
    "a pan": [picture(2, 640)[:, shift : shift + 128] for shift in range(0, 500, 12)],
    "a turn of exposure": [STILL * 2 ** (-stops / 2.2) for stops in np.arange(0, 2, 0.08)],
    "a wall at a bin's edge": [np.full((*SIZE, 3), 119.0 + 2 * (n % 2)) for n in range(9)],
    "a fade to black": [STILL * (1 - share) for share in np.linspace(0, 1, 25)],
    "a slow cross-fade": [STILL * (1 - t) + OTHER * t for t in np.linspace(0, 1, 25)],
    "black": [np.zeros((*SIZE, 3))] * 3,
    "a growing window": [picture(0)[: 40 + n, : 50 + n] for n in range(20)],
}


@pytest.mark.parametrize("images", CALM.values(), ids=CALM)
def test_no_cut_is_told_where_there_is_none(images):
    assert cuts(images) == []


@pytest.mark.parametrize("seed", range(8))
def test_every_cut_is_told_and_nothing_else(seed):
    lengths = np.random.default_rng(seed).integers(2, 12, 6)
    scenes = [
        noisy(picture(100 * seed + k), count, seed=k) for k, count in enumerate(map(int, lengths))
    ]
    found, expected = cuts(np.concatenate(scenes)), np.cumsum(lengths)[:-1].tolist()
    assert found == expected


@pytest.mark.parametrize("level", [0.0, 255.0])
def test_black_and_white_frames_are_scenes_of_their_own(level):
    blank = np.full((2, *SIZE, 3), level)
    assert cuts(np.concatenate([noisy(STILL, 4), blank, noisy(STILL, 4)])) == [4, 6]


def test_a_flash_is_told_once():
    images = noisy(STILL, 8)
    images[4] = 255
    assert cuts(images) == [4]


def test_a_cut_in_the_middle_of_a_pan():
    pan = [picture(2, 640)[:, shift : shift + 128] for shift in range(0, 120, 12)]
    assert cuts([*pan, *(255 - np.array(pan))]) == [10]


@pytest.mark.parametrize("shape", [(1, 1), (1, 300), (300, 1), (63, 65), (1080, 1920)])
def test_frames_of_every_size(shape):
    images = [np.full((*shape, 3), level) for level in (10.0, 10.0, 200.0)]
    assert cuts(images) == [2]
    bins = histogram(np.uint8(images[0]))
    assert bins.shape == (3, 16)
    np.testing.assert_allclose(bins.sum(axis=1), 1)


@pytest.mark.parametrize("level", range(0, 256, 5))
def test_a_level_is_shared_by_the_bins_around_it(level):
    bins = histogram(np.full((4, 4, 3), level, np.uint8))[0]
    assert bins @ np.arange(16) * 17 == pytest.approx(level)
    assert np.count_nonzero(bins > 1e-12) <= 2


def test_the_distance_is_a_share_of_pixels_in_the_worst_channel():
    one = np.zeros((8, 8, 3), np.uint8)
    other = one.copy()
    other[:2, :, 0], other[:4, :, 1] = 255, 255
    assert distance(histogram(one), histogram(other)) == pytest.approx(0.5)
    assert distance(histogram(one), histogram(255 - one)) == pytest.approx(1)
    assert distance(histogram(one), histogram(one)) == 0
