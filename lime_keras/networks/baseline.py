"""The subnetwork of the reflectance-map baseline alone: ReflectanceMapNet."""

import keras

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import decoder, encoder


def reflectance_map_net(architecture: Architecture) -> keras.Model:
    """Build ReflectanceMapNet: `masked_image` `(B, S, S, 3)` sRGB → reflectance map.

    The output `(B, S, S, 3)` is compressed radiance. The map shows a sphere, so its pixels do not
    correspond to pixels of the image, and the network has no skip connections.
    """
    size, width = architecture.size, architecture.encoder_width
    masked_image = keras.Input((size, size, 3), name="masked_image")
    features = encoder(masked_image, width=width, dense_width=architecture.dense_width)
    sphere = decoder(features, size=size, width=width, channels=3)
    return keras.Model(masked_image, sphere, name="reflectance_map_net")
