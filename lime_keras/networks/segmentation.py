"""SegmentationNet: colour image → mask."""

import keras

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import unet


def segmentation_net(architecture: Architecture) -> keras.Model:
    """`image` `(B, S, S, 3)` sRGB in [0, 1] → `(B, S, S, 1)` coverage, not yet clipped to [0, 1].

    The head is linear: under the paper's ℓ2 a sigmoid saturated within the first steps and never
    came back (docs/decisions.md).
    """
    size = architecture.size
    image = keras.Input((size, size, 3), name="image")
    mask = unet(image, width=architecture.unet_width, depth=architecture.unet_depth)
    return keras.Model(image, mask, name="segmentation_net")
