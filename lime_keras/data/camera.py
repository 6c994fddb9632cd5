"""A consumer camera, as an augmentation: the photo one would have taken of a rendered scene.

Light → exposure → defocus → noise → clipping → sRGB → 8 bits → JPEG, inside a `tf.data` graph.
White balance is not touched: section 4 of the paper takes white-balanced photos.
"""

import functools

import numpy as np
import tensorflow as tf
import tensorflow.experimental.numpy as tnp

from lime_keras.optics import colour

SCENE = (
    "image",
    "mask",
    "diffuse_shading",
    "specular_shading",
    "diffuse_albedo",
    "specular_albedo",
    "ambient",
)
"""Features of an example without which no photo of it can be taken."""

_STOPS = 0.5  # either way: how far automatic exposure strays from the corpus' fixed one
_CONFUSION = 1.5 / 256  # largest radius by image width: soft when looked at closely, σ 0.8 / 256
_FULL_WELL = 1_000.0, 30_000.0  # electrons at white: a phone by lamplight, a large sensor by day
_READ_NOISE = 2.0  # electrons, of a present CMOS sensor
_QUALITY = 60.0, 98.0  # JPEG: from what messengers send to what cameras store
_NEVER_COMPRESSED = 0.2  # share of photos: frames of a live video never were a JPEG

_ROOT_LEVELS = 4096  # of the table from √radiance to sRGB: steps below a tenth of an 8-bit level
_LIT = ("diffuse_shading", "specular_shading", "mirror", "ambient", "environment")
_GRAIN_ROWS, _GRAIN_LENGTH = 4096, 64


def photograph(
    example: dict[str, tf.Tensor], seed: tf.Tensor | None = None
) -> dict[str, tf.Tensor]:
    """Photograph an example's scene with a camera drawn at random.

    Exposure multiplies the light, so D, S, M, m_a and the environment change with the image while
    the albedos stay, and Eq. 4 stays true. Where the stored image is clipped the scene's own
    radiance, from Eq. 4, is exposed.

    Args:
        example: as `records.parse` gives it, with the features of `SCENE` at least.
        seed: `(2,)` integers; the same seed, the same photo. By default the example's own `seed`
            and `index`.

    Returns:
        The example with another `image`, a multiple of 1/255; with `clipped` `(S, S, 3)`, 1 where
        the light saturated the sensor, noise apart; and with its light scaled by the exposure.
    """
    if seed is None:
        seed = tf.stack([example["seed"], example["index"]])
    seeds = tf.random.split(seed)
    stops, defocus, well, quality, kept = tf.unstack(tf.random.stateless_uniform((5,), seeds[0]))
    exposure = 2.0 ** (_STOPS * (2.0 * stops - 1.0))
    out = dict(example)
    for name in _LIT:
        if name in example:
            out[name] = example[name] * exposure
    light = _defocused(_radiance(out, exposure), defocus)
    saturated = light >= np.float32(colour.srgb_to_linear(colour.CLIPPED))
    out["clipped"] = tf.cast(saturated, tf.float32)
    low, high = _FULL_WELL
    levels = _sensed(light, low * (high / low) ** well, seeds[1])
    low, high = _QUALITY
    pixels = tf.cond(
        kept < _NEVER_COMPRESSED,
        lambda: levels,
        lambda: _compressed(levels, tf.cast(tf.round(low + (high - low) * quality), tf.int32)),
    )
    out["image"] = tf.ensure_shape(tf.cast(pixels, tf.float32) / 255.0, example["image"].shape)
    return out


def _radiance(example: dict[str, tf.Tensor], exposure: tf.Tensor) -> tf.Tensor:
    """Linear radiance `(S, S, 3)` of a scene in exposed light, whose image is not exposed yet.

    A pixel is at least as bright as the object's share of it, and brighter than the stored image
    only where that is clipped.
    """
    levels = tf.cast(example["image"] * 255.0 + 0.5, tf.int32)
    decoded = colour.srgb_to_linear(np.arange(256) / 255).astype(np.float32)
    return tf.maximum(_look_up(decoded * exposure, levels), objects_share(example))


def objects_share(example: dict[str, tf.Tensor]) -> tf.Tensor:
    """What of each pixel's light comes from the object: coverage × Eq. 4, `(S, S, 3)`, not clipped.

    Of an example with the features of `SCENE`. A matrix product is thrice as fast as broadcasting.
    """
    grey = example["specular_albedo"] * example["specular_shading"] + example["ambient"]
    layers = tf.stack([example["diffuse_shading"] * example["mask"], grey * example["mask"]])
    weights = tf.stack([example["diffuse_albedo"], tf.ones(3)])
    product = tf.matmul(tf.reshape(layers, (2, -1)), weights, transpose_a=True)
    return tf.reshape(product, tf.shape(example["image"]))


def _defocused(light: tf.Tensor, strength: tf.Tensor) -> tf.Tensor:
    """Blur of `(S, S, 3)` by a circle of confusion; what lies beyond the edges mirrors the inside.

    A circle that fits into a pixel blurs nothing.
    """
    largest = _CONFUSION * tf.cast(tf.shape(light)[0], tf.float32)
    radius = strength * largest

    def blurred() -> tf.Tensor:
        reach = tf.math.ceil(largest - 0.5)
        offsets = tf.range(-reach, reach + 1.0)
        distances = tf.sqrt(tf.square(offsets) + tf.square(offsets[:, None]))
        disc = tf.clip_by_value(radius + 0.5 - distances, 0.0, 1.0)
        disc /= tf.reduce_sum(disc)
        margin = tf.repeat(tf.cast(reach, tf.int32), 2)
        padded = tf.pad(light, tf.stack([margin, margin, tf.zeros_like(margin)]), "SYMMETRIC")
        kernel = tf.tile(disc[..., None, None], (1, 1, 3, 1))
        return tf.nn.depthwise_conv2d(padded[None], kernel, (1, 1, 1, 1), "VALID")[0]

    return tf.cond(radius <= 0.5, lambda: light, blurred)


def _sensed(light: tf.Tensor, full_well: tf.Tensor, seed: tf.Tensor) -> tf.Tensor:
    """The sensor's answer to radiance: noisy, clipped, sRGB, `(S, S, 3)` uint8.

    With N electrons at white and r of read noise, the variance is (L + r²/N) / N. The root of
    L + r²/N then has variance 1/4N wherever it lies, so the noise is added to the root, and the
    1/4N that squaring adds to the mean is taken off again.
    """
    dark = _READ_NOISE**2 / full_well
    deviation = 0.5 * tf.math.rsqrt(full_well)
    root = tf.sqrt(light + dark) + deviation * _grain(tf.shape(light), seed)
    # Up to the root that stands for 1; beyond it all is white.
    scale = _ROOT_LEVELS * tf.math.rsqrt(1.0 + dark + deviation**2)
    bins = tf.clip_by_value(root * scale, 0.0, _ROOT_LEVELS - 1.0)
    centres = (tf.range(_ROOT_LEVELS, dtype=tf.float32) + 0.5) / scale
    linear = tf.square(centres) - dark - deviation**2
    srgb = colour.linear_to_srgb(tf.clip_by_value(linear, 0.0, 1.0), tnp)
    levels = tf.cast(srgb * 255.0 + 0.5, tf.uint8)
    return _look_up(levels, tf.cast(bins, tf.int32))


def _compressed(levels: tf.Tensor, quality: tf.Tensor) -> tf.Tensor:
    """There and back through a JPEG, its chroma at half resolution as cameras write it."""
    jpeg = tf.raw_ops.EncodeJpegVariableQuality(images=levels, quality=quality)
    return tf.io.decode_jpeg(jpeg, 3)


def _look_up(table: tf.Tensor | np.ndarray, indices: tf.Tensor) -> tf.Tensor:
    """Entries of a table `(N,)`; `tf.gather` takes half as long again."""
    return tf.gather_nd(table, indices[..., None])


def _grain(shape: tf.Tensor, seed: tf.Tensor) -> tf.Tensor:
    """Standard normal numbers of that shape, in rows drawn from a table.

    To draw them one by one would take as long as decoding all of the example's pictures.
    """
    count = tf.reduce_prod(shape)
    rows = tf.random.stateless_uniform([-(-count // _GRAIN_LENGTH)], seed, 0, _GRAIN_ROWS, tf.int32)
    return tf.reshape(tf.reshape(tf.gather(_grain_table(), rows), [-1])[:count], shape)


@functools.cache
def _grain_table() -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.standard_normal((_GRAIN_ROWS, _GRAIN_LENGTH), np.float32)
