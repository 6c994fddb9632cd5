"""The camera: a photo of a scene's linear radiance, as a consumer camera would take it.

Light → exposure → defocus → white balance → noise → clipping → sRGB → 8 bits → JPEG, inside a
`tf.data` graph.
"""

import numpy as np
import tensorflow as tf
import tensorflow.experimental.numpy as tnp

from lime_keras.optics import camera_law, colour

SCENE = (
    "image",
    "mask",
    "diffuse_shading",
    "specular_shading",
    "diffuse_albedo",
    "specular_albedo",
    "ambient",
)
"""Features of an example that a photo of it needs."""

_LEVELS = 2**16  # of the table from radiance to sRGB: a step is at most 0.05 of an 8-bit level
_UNPAINTED = 1e-4  # largest share of paint in a pixel's light that is only rounding
_ROOT_LEVELS = 4096  # of the table from √radiance to sRGB: a step is below 0.1 of an 8-bit level


def photograph(
    example: dict[str, tf.Tensor], radiance: tf.Tensor, seed: tf.Tensor | None = None
) -> dict[str, tf.Tensor]:
    """Photograph a scene with a random camera.

    The exposure multiplies the light: the image, D, S, M, m_a and the environment are scaled, and
    the albedos stay, so Eq. 4 still holds.

    Args:
        example: example from `records.parse`. `painted` `(S, S, 1)`, above 0 where something that
            its layers do not know was painted on, may be among its features.
        radiance: linear radiance of the scene `(S, S, 3)`, at least 0, not clipped (`radiance`).
        seed: `(2,)` integers; the same seed gives the same photo. By default the example's own
            `seed` and `index`.

    Returns:
        The example with a new `image`, sRGB in multiples of 1/255; with `clipped` `(S, S, 3)`, 1
        where the light, without the noise, saturates the sensor; with `cast` `(4,)`, the error of
        the white balance (`camera_law.cast`); with `painted` 1 wherever defocus carries paint; and
        with its light scaled by the exposure.
    """
    if seed is None:
        seed = tf.stack([example["seed"], example["index"]])
    seeds = tf.random.split(seed)
    stops, defocus, well, quality, kept = tf.unstack(tf.random.stateless_uniform((5,), seeds[0]))
    exposure = camera_law.exposure(stops)
    out = dict(example)
    for name in camera_law.LIT:
        if name in example:
            out[name] = example[name] * exposure
    drawn = tf.random.stateless_uniform((1, 4), tf.random.split(seed, 3)[2])
    cast = camera_law.cast(drawn)
    light = radiance * exposure
    if "painted" in example:
        spread = _defocused(tf.concat([light, example["painted"]], -1), defocus)
        light, out["painted"] = spread[..., :3], tf.cast(spread[..., 3:] > _UNPAINTED, tf.float32)
    else:
        light = _defocused(light, defocus)
    size = tf.shape(light)[0]
    place = (tf.range(size, dtype=tf.float32) + 0.5) * (2.0 / tf.cast(size, tf.float32)) - 1.0
    light *= tf.cast(camera_law.balance(cast, place, tnp)[0], tf.float32)
    out["cast"] = cast[0]
    out["clipped"] = tf.cast(light >= camera_law.SATURATED, tf.float32)
    levels = _sensed(light, camera_law.full_well(well), seeds[1])
    pixels = tf.cond(
        kept < camera_law.NEVER_COMPRESSED,
        lambda: levels,
        lambda: _compressed(levels, tf.cast(tf.round(camera_law.quality(quality)), tf.int32)),
    )
    out["image"] = tf.ensure_shape(tf.cast(pixels, tf.float32) / 255.0, example["image"].shape)
    return out


def radiance(example: dict[str, tf.Tensor]) -> tf.Tensor:
    """Return the linear radiance `(S, S, 3)` of a stored scene, not clipped.

    A pixel is at least as bright as the object's share of it. It is brighter than the stored image
    only where that is clipped.

    Args:
        example: example from `records.parse`, with the features of `SCENE` at least.
    """
    return tf.maximum(linear(example["image"]), objects_share(example))


def developed(light: tf.Tensor) -> tf.Tensor:
    """Return linear radiance as the image of a scene is stored: clipped at 1, sRGB, 8 bits."""
    # Powers of all pixels would take as long as decoding the image.
    srgb = colour.linear_to_srgb((np.arange(_LEVELS) + 0.5) / _LEVELS)
    table = np.round(srgb * 255).astype(np.uint8)
    levels = tf.cast(tf.clip_by_value(light, 0.0, 1.0) * (_LEVELS - 1), tf.int32)
    return tf.cast(look_up(table, levels), tf.float32) / 255.0


def linear(image: tf.Tensor) -> tf.Tensor:
    """Return the linear radiance of an sRGB image in multiples of 1/255, by a table."""
    return look_up(colour.LEVELS, tf.cast(image * 255.0 + 0.5, tf.int32))


def objects_share(example: dict[str, tf.Tensor]) -> tf.Tensor:
    """Return the object's share of each pixel's light: coverage × Eq. 4, `(S, S, 3)`, not clipped.

    The share is linear radiance. The example needs the features of `SCENE`.
    """
    grey = example["specular_albedo"] * example["specular_shading"] + example["ambient"]
    layers = tf.stack([example["diffuse_shading"] * example["mask"], grey * example["mask"]])
    weights = tf.stack([example["diffuse_albedo"], tf.ones(3)])
    product = tf.matmul(tf.reshape(layers, (2, -1)), weights, transpose_a=True)
    return tf.reshape(product, tf.shape(example["image"]))


def _defocused(light: tf.Tensor, strength: tf.Tensor) -> tf.Tensor:
    """Blur light `(S, S, C)` by a circle of confusion whose radius is `strength` × the largest.

    The image is mirrored beyond its edges. A circle that fits into a pixel leaves the light as it
    is.
    """
    largest = camera_law.CONFUSION * tf.cast(tf.shape(light)[0], tf.float32)
    radius = strength * largest

    def blurred() -> tf.Tensor:
        reach = tf.math.ceil(largest - 0.5)
        offsets = tf.range(-reach, reach + 1.0)
        distances = tf.sqrt(tf.square(offsets) + tf.square(offsets[:, None]))
        disc = tf.clip_by_value(radius + 0.5 - distances, 0.0, 1.0)
        disc /= tf.reduce_sum(disc)
        margin = tf.repeat(tf.cast(reach, tf.int32), 2)
        padded = tf.pad(light, tf.stack([margin, margin, tf.zeros_like(margin)]), "SYMMETRIC")
        kernel = tf.tile(disc[..., None, None], (1, 1, light.shape[-1], 1))
        return tf.nn.depthwise_conv2d(padded[None], kernel, (1, 1, 1, 1), "VALID")[0]

    return tf.cond(radius <= 0.5, lambda: light, blurred)


def _sensed(light: tf.Tensor, full_well: tf.Tensor, seed: tf.Tensor) -> tf.Tensor:
    """Return the sensor's image of linear radiance: noisy, clipped, sRGB `(S, S, 3)` uint8.

    The noise is added to the root of the radiance (`camera_law.READ_NOISE`).
    """
    dark = camera_law.READ_NOISE**2 / full_well
    deviation = 0.5 * tf.math.rsqrt(full_well)
    root = tf.sqrt(light + dark) + deviation * _grain(tf.shape(light), seed)
    # The table ends at the root of radiance 1; everything brighter is white.
    scale = _ROOT_LEVELS * tf.math.rsqrt(1.0 + dark + deviation**2)
    bins = tf.clip_by_value(root * scale, 0.0, _ROOT_LEVELS - 1.0)
    centres = (tf.range(_ROOT_LEVELS, dtype=tf.float32) + 0.5) / scale
    linear = tf.square(centres) - dark - deviation**2
    srgb = colour.linear_to_srgb(tf.clip_by_value(linear, 0.0, 1.0), tnp)
    levels = tf.cast(srgb * 255.0 + 0.5, tf.uint8)
    return look_up(levels, tf.cast(bins, tf.int32))


def _compressed(levels: tf.Tensor, quality: tf.Tensor) -> tf.Tensor:
    """Compress pixels as a JPEG and decode it; chroma has half resolution, as in cameras."""
    jpeg = tf.raw_ops.EncodeJpegVariableQuality(images=levels, quality=quality)
    return tf.io.decode_jpeg(jpeg, 3)


def look_up(table: tf.Tensor | np.ndarray, indices: tf.Tensor) -> tf.Tensor:
    """Return the entries of a table `(N,)` at `indices`; `tf.gather` takes 1.5 times as long."""
    return tf.gather_nd(table, indices[..., None])


def _grain(shape: tf.Tensor, seed: tf.Tensor) -> tf.Tensor:
    """Return standard normal numbers of a shape, in rows drawn from a table.

    Drawing each number would take as long as decoding all pictures of the example.
    """
    count = tf.reduce_prod(shape)
    rows = tf.random.stateless_uniform(
        [-(-count // camera_law.GRAIN_LENGTH)], seed, 0, camera_law.GRAIN_ROWS, tf.int32
    )
    return tf.reshape(tf.reshape(tf.gather(camera_law.grain_table(), rows), [-1])[:count], shape)
