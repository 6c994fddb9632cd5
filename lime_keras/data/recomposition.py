"""The image of a scene that was painted anew, recomposed by Eq. 4."""

import numpy as np
import tensorflow as tf

from lime_keras.data.camera import look_up, objects_share
from lime_keras.optics import colour

_LEVELS = 2**16
"""Length of the table from radiance to sRGB: a step is at most 0.05 of an 8-bit level."""


def recompose(example: dict[str, tf.Tensor], stored: dict[str, tf.Tensor]) -> tf.Tensor:
    """Return the image of a changed scene before the background of the stored scene.

    Where the object fills the pixel, Eq. 4 with the layers gives the exact image. At the silhouette
    the background's share is the stored image minus the object's stored share, at least 0. If the
    stored image is clipped there, this is only a lower bound.

    Args:
        example: the stored example with other albedos.
        stored: example from `records.parse`, with the features of `camera.SCENE` at least.

    Returns:
        The image `(S, S, 3)`, sRGB in multiples of 1/255.
    """
    levels = tf.cast(stored["image"] * 255.0 + 0.5, tf.int32)
    linear = look_up(colour.srgb_to_linear(np.arange(256) / 255).astype(np.float32), levels)
    background = tf.maximum(linear - objects_share(stored), 0.0)
    background = tf.where(stored["mask"] < 1.0, background, 0.0)
    composed = tf.clip_by_value(background + objects_share(example), 0.0, 1.0)
    # Powers of all pixels would take as long as decoding the image.
    srgb = colour.linear_to_srgb((np.arange(_LEVELS) + 0.5) / _LEVELS)
    table = np.round(srgb * 255).astype(np.uint8)
    encoded = look_up(table, tf.cast(composed * (_LEVELS - 1), tf.int32))
    return tf.cast(encoded, tf.float32) / 255.0
