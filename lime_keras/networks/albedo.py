"""AlbedoNet: masked colour image and specular shading S → diffuse and specular albedo."""

import keras
from keras import layers

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import encoder


def albedo_net(architecture: Architecture) -> keras.Model:
    """`masked_image` `(B, S, S, 3)` sRGB and compressed S `(B, S, S, 1)` → m_d, m_s.

    The answer is `(B, 4)`: linear RGB diffuse albedo, then specular albedo, not yet clipped to
    [0, 1].
    """
    size = architecture.size
    masked_image = keras.Input((size, size, 3), name="masked_image")
    shading = keras.Input((size, size, 1), name="specular_shading")
    four_channels = layers.Concatenate(name="layers")([masked_image, shading])
    features = encoder(
        four_channels, width=architecture.encoder_width, dense_width=architecture.dense_width
    )
    albedos = layers.Dense(4, dtype="float32", name="albedos")(features)
    return keras.Model([masked_image, shading], albedos, name="albedo_net")
