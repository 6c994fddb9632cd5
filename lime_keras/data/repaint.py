"""The repaint augmentation: a scene with other albedos, and the same shape, light and exponent."""

import tensorflow as tf
import tensorflow.experimental.numpy as tnp

from lime_keras.data.camera import objects_share
from lime_keras.optics import colour


def repaint(example: dict[str, tf.Tensor], seed: tf.Tensor) -> dict[str, tf.Tensor]:
    """Draw new m_d and m_s for the object, as in section 5.1, and recompose its image.

    D, S and M do not depend on the albedos. So Eq. 4 with the stored layers gives the exact image
    of the repainted object where it fills the pixel. At the silhouette the background's share is
    the stored image minus the object's old share, at least 0. If the stored image is clipped there,
    this is only a lower bound.

    Args:
        example: example from `records.parse`, with the features of `camera.SCENE` at least.
        seed: `(2,)` integers; the same seed gives the same albedos.

    Returns:
        The example with a new `image`, sRGB in multiples of 1/255, a new `diffuse_albedo` `(3,)`
        and a new `specular_albedo` `()`; m_a stays.
    """
    # Section 5.1 draws uniformly in YUV and keeps valid RGB. This is uniform in RGB, because the
    # conversion is linear.
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
    """Return values as float32; TensorFlow's NumPy functions widen them."""
    return tf.cast(values, tf.float32)
