"""The image of a scene that was lit or painted anew, recomposed by Eq. 4."""

import tensorflow as tf
import tensorflow.experimental.numpy as tnp

from lime_keras.data.camera import objects_share
from lime_keras.optics import colour


def recompose(example: dict[str, tf.Tensor], stored: dict[str, tf.Tensor]) -> tf.Tensor:
    """Return the image of a changed scene before the background of the stored scene.

    Where the object fills the pixel, Eq. 4 with the layers gives the exact image. At the silhouette
    the background's share is the stored image minus the object's stored share, at least 0. If the
    stored image is clipped there, this is only a lower bound.

    Args:
        example: the stored example with other albedos, D or S.
        stored: example from `records.parse`, with the features of `camera.SCENE` at least.

    Returns:
        The image `(S, S, 3)`, sRGB in multiples of 1/255.
    """
    linear = _as_float(colour.srgb_to_linear(stored["image"], tnp))
    background = tf.maximum(linear - objects_share(stored), 0.0)
    background = tf.where(stored["mask"] < 1.0, background, 0.0)
    composed = tf.clip_by_value(background + objects_share(example), 0.0, 1.0)
    srgb = _as_float(colour.linear_to_srgb(composed, tnp))
    return tf.round(srgb * 255.0) / 255.0


def _as_float(values: tf.Tensor) -> tf.Tensor:
    """Return values as float32; TensorFlow's NumPy functions widen them."""
    return tf.cast(values, tf.float32)
