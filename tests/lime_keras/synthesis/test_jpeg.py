"""JPEG in `keras.ops` against libjpeg."""

import numpy as np
import pytest
import tensorflow as tf

from lime_keras.synthesis import jpeg

SIZE = 64


def natural(count=6, size=SIZE):
    """Images with slopes, borders, colours and a little noise, in 8-bit levels."""
    rng = np.random.default_rng(0)
    coarse = rng.uniform(0, 255, (count, 5, 5, 3)).astype(np.float32)
    images = tf.image.resize(coarse, (size, size), "bicubic").numpy()
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    for image in images:
        a, b, c = rng.normal(size=3)
        image[a * x + b * y > c * size / 2] *= rng.uniform(0.2, 0.9)
    images += rng.normal(0, 2, images.shape)
    return np.round(np.clip(images, 0, 255)).astype(np.float32)


def by_libjpeg(images, quality):
    """Of its three inverse transforms the accurate one, which libraries use by default."""

    def one(image):
        encoded = tf.raw_ops.EncodeJpegVariableQuality(
            images=tf.cast(image, tf.uint8), quality=quality
        )
        return tf.io.decode_jpeg(encoded, 3, dct_method="INTEGER_ACCURATE")

    return np.array([one(image) for image in images], np.float32)


def ours(images, quality):
    qualities = np.broadcast_to(np.float32(quality), len(images))
    return jpeg.compressed(tf.constant(images), tf.constant(qualities)).numpy()


@pytest.mark.parametrize("quality", [30, 45, 60, 80, 98, 100])
def test_it_is_what_libjpeg_does(quality):
    images = natural()
    difference = ours(images, quality) - by_libjpeg(images, quality)
    assert np.abs(difference).mean() < 0.5
    assert np.abs(difference.mean(axis=(0, 1, 2))).max() < 0.1
    lost = np.abs(by_libjpeg(images, quality) - images).mean()
    assert np.abs(difference).mean() < lost / 3


def test_grey_is_what_libjpeg_does_nearly_everywhere():
    grey = np.repeat(natural()[..., :1], 3, axis=-1)
    difference = ours(grey, 80) - by_libjpeg(grey, 80)
    assert np.mean(difference != 0) < 0.3 and np.abs(difference).mean() < 0.35


def test_chroma_of_flat_blocks_is_interpolated_as_libjpeg_does():
    """Blocks of one colour each: only colour conversion, halving and doubling count."""
    rng = np.random.default_rng(1)
    colours = rng.integers(0, 256, (2, 4, 4, 3)).astype(np.float32)
    images = colours.repeat(16, axis=1).repeat(16, axis=2)
    difference = ours(images, 100) - by_libjpeg(images, 100)
    assert np.abs(difference).max() <= 2 and np.abs(difference).mean() < 0.1


def test_every_image_has_its_own_quality():
    images = natural(3)
    qualities = [60.0, 80.0, 98.0]
    together = ours(images, qualities)
    for image, quality, found in zip(images, qualities, together, strict=True):
        np.testing.assert_array_equal(ours(image[None], quality)[0], found)
    assert not np.array_equal(ours(images, 60.0)[1], together[1])


@pytest.mark.parametrize("quality", [1, 45, 50, 75, 99, 100])
def test_the_steps_are_libjpegs(quality):
    scale = 5000 // quality if quality < 50 else 200 - 2 * quality
    for table in (jpeg._LUMINANCE_STEPS, jpeg._CHROMINANCE_STEPS):
        expected = np.clip((table.astype(int) * scale + 50) // 100, 1, 255)
        np.testing.assert_array_equal(
            jpeg._steps(table, tf.constant([float(quality)]))[0], expected
        )


@pytest.mark.parametrize("level", [0, 255])
@pytest.mark.parametrize("quality", [1, 60, 100])
def test_black_and_white_stay(level, quality):
    image = np.full((1, 16, 32, 3), level, np.float32)
    np.testing.assert_array_equal(ours(image, quality), image)


def test_levels_stay_whole_and_within_bounds():
    noise = np.random.default_rng(0).choice([0.0, 255.0], (2, 32, 32, 3)).astype(np.float32)
    found = ours(noise, 10)
    np.testing.assert_array_equal(found, np.round(found))
    assert found.min() == 0 and found.max() == 255


def test_sides_that_blocks_do_not_fill_are_refused():
    with pytest.raises(ValueError, match=r"multiples of 16, not 16 x 24"):
        jpeg.compressed(np.zeros((1, 16, 24, 3), np.float32), np.ones(1, np.float32))
