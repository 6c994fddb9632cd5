"""ReflectanceMapNet of the baseline: masked colour image → reflectance map."""

import keras

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import decoder, encoder


def reflectance_map_net(architecture: Architecture) -> keras.Model:
    """`masked_image` `(B, S, S, 3)` sRGB in [0, 1] → `(B, S, S, 3)` compressed reflectance map.

    The map shows a sphere, so its pixels are not the image's, and there are no skip connections.
    """
    size, width = architecture.size, architecture.encoder_width
    masked_image = keras.Input((size, size, 3), name="masked_image")
    features = encoder(masked_image, width=width, dense_width=architecture.dense_width)
    sphere = decoder(features, size=size, width=width, channels=3)
    return keras.Model(masked_image, sphere, name="reflectance_map_net")
