"""A scene of another colour and gloss, as an augmentation: the same shape, light and exponent."""

import tensorflow as tf
import tensorflow.experimental.numpy as tnp

from lime_keras.data.camera import objects_share
from lime_keras.optics import colour


def repaint(example: dict[str, tf.Tensor], seed: tf.Tensor) -> dict[str, tf.Tensor]:
    """Give the object m_d and m_s drawn anew, as section 5.1 draws them.

    D, S and M do not depend on either, so Eq. 4 of the stored layers is the picture of the same
    object in other paint: no approximation, where it fills the pixel. At the silhouette the
    background's share is what the stored picture shows beyond the object's, at least nothing; what
    was clipped there stays a lower bound.

    Args:
        example: as `records.parse` gives it, with the features of `camera.SCENE` at least.
        seed: `(2,)` integers; the same seed, the same paint.

    Returns:
        The example with another `image`, a multiple of 1/255 as stored ones are, another
        `diffuse_albedo` `(3,)` and another `specular_albedo` `()`; m_a stays.
    """
    # Uniform in YUV, and an RGB colour, is uniform in RGB: the change between them is linear.
    drawn = tf.random.stateless_uniform((4,), seed)
    out = dict(example)
    out["diffuse_albedo"], out["specular_albedo"] = drawn[:3], drawn[3]
    linear = _as_float(colour.srgb_to_linear(example["image"], tnp))
    background = tf.maximum(linear - objects_share(example), 0.0)
    background = tf.where(example["mask"] < 1.0, background, 0.0)
    painted = tf.clip_by_value(background + objects_share(out), 0.0, 1.0)
    srgb = _as_float(colour.linear_to_srgb(painted, tnp))
    out["image"] = tf.round(srgb * 255.0) / 255.0
    return out


def _as_float(values: tf.Tensor) -> tf.Tensor:
    """float32 again, which TensorFlow's NumPy functions widen."""
    return tf.cast(values, tf.float32)
