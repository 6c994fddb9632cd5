"""SpecularNet: masked colour image → specular shading S."""

import keras

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import unet


def specular_net(architecture: Architecture) -> keras.Model:
    """`masked_image` `(B, S, S, 3)` sRGB in [0, 1] → `(B, S, S, 1)` compressed S."""
    size = architecture.size
    masked_image = keras.Input((size, size, 3), name="masked_image")
    shading = unet(masked_image, width=architecture.unet_width, depth=architecture.unet_depth)
    return keras.Model(masked_image, shading, name="specular_net")
