"""MirrorNet: specular shading S → mirror image M."""

import keras

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import unet


def mirror_net(architecture: Architecture) -> keras.Model:
    """`specular_shading` `(B, S, S, 1)` compressed → `(B, S, S, 1)` compressed M."""
    size = architecture.size
    shading = keras.Input((size, size, 1), name="specular_shading")
    mirror = unet(shading, width=architecture.unet_width, depth=architecture.unet_depth)
    return keras.Model(shading, mirror, name="mirror_net")
