"""The two subnetworks of the reflectance-map baseline: ReflectanceMapNet and MaterialNet."""

import keras
from keras import layers

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import decoder, encoder
from lime_keras.optics.shininess import BIN_COUNT


def reflectance_map_net(architecture: Architecture) -> keras.Model:
    """Build ReflectanceMapNet: `masked_image` `(B, S, S, 3)` sRGB → reflectance map.

    The output `(B, S, S, 3)` is compressed radiance. The map shows a sphere, so its pixels do not
    correspond to pixels of the image, and the network has no skip connections.
    """
    size, width = architecture.size, architecture.encoder_width
    masked_image = keras.Input((size, size, 3), name="masked_image")
    features = encoder(masked_image, width=width, dense_width=architecture.dense_width)
    sphere = decoder(features, size=size, width=width)
    return keras.Model(masked_image, sphere, name="reflectance_map_net")


def material_net(architecture: Architecture) -> keras.Model:
    """Build MaterialNet: compressed `reflectance_map` `(B, S, S, 3)` → albedos and exponent bins.

    The outputs are `(B, 8)`, the logits of the exponent's bins, and `(B, 4)`, m_d and m_s, linear
    and not yet clipped to [0, 1].
    """
    size = architecture.size
    sphere = keras.Input((size, size, 3), name="reflectance_map")
    features = encoder(
        sphere, width=architecture.encoder_width, dense_width=architecture.dense_width
    )
    albedos = layers.Dense(4, dtype="float32", name="albedos")(features)
    logits = layers.Dense(BIN_COUNT, dtype="float32", name="logits")(features)
    # Files of weights number the layers in the order of the outputs.
    return keras.Model(sphere, [logits, albedos], name="material_net")
