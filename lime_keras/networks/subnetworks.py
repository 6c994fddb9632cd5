"""The five subnetworks of section 5; their inputs are named after the quantities they read."""

import keras
from keras import layers

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import HueOfPixels, encoder, unet
from lime_keras.optics.shininess import BIN_COUNT, LOG_HIGH, LOG_LOW


def segmentation_net(architecture: Architecture) -> keras.Model:
    """Build SegmentationNet: `image` `(B, S, S, 3)` sRGB in [0, 1] → `(B, S, S, 1)` coverage.

    The output is not yet clipped to [0, 1]. The head is linear: under the paper's ℓ2 loss a sigmoid
    saturated within the first steps and did not recover (docs/explanation/decisions.md).
    """
    size = architecture.size
    image = keras.Input((size, size, 3), name="image")
    mask = _unet(image, architecture, channels=1)
    return keras.Model(image, mask, name="segmentation_net")


def specular_net(architecture: Architecture) -> keras.Model:
    """Build SpecularNet: `masked_image` `(B, S, S, 3)` sRGB → `(B, S, S, 1)` compressed S."""
    size = architecture.size
    masked_image = keras.Input((size, size, 3), name="masked_image")
    shading = _unet(masked_image, architecture, channels=1)
    return keras.Model(masked_image, shading, name="specular_net")


def mirror_net(architecture: Architecture) -> keras.Model:
    """Build MirrorNet: compressed `specular_shading` `(B, S, S, 1)` → compressed M, same shape."""
    size = architecture.size
    shading = keras.Input((size, size, 1), name="specular_shading")
    mirror = _unet(shading, architecture, channels=1)
    return keras.Model(shading, mirror, name="mirror_net")


def exponent_net(architecture: Architecture) -> keras.Model:
    """Build ExponentNet: compressed S and M, each `(B, S, S, 1)` → `(B, 8)` logits of the bins.

    The registry turns the logits into probabilities by softmax; the loss needs the logits. In a
    system without MirrorNet the input is S alone. With regression the output is log10 s, `(B, 1)`.
    """
    size = architecture.size
    names = ["specular_shading", "mirror"] if architecture.mirror else ["specular_shading"]
    inputs = [keras.Input((size, size, 1), name=name) for name in names]
    seen = layers.Concatenate(name="layers")(inputs) if architecture.mirror else inputs[0]
    features = encoder(seen, width=architecture.encoder_width, dense_width=architecture.dense_width)
    if architecture.exponent == "regression":
        # Training starts from the middle of the range: a bias of 0 is the dullest material.
        middle = keras.initializers.Constant((LOG_LOW + LOG_HIGH) / 2)
        answer = layers.Dense(1, dtype="float32", bias_initializer=middle, name="log_exponent")(
            features
        )
    else:
        answer = layers.Dense(BIN_COUNT, dtype="float32", name="logits")(features)
    return keras.Model(inputs, answer, name="exponent_net")


def albedo_net(architecture: Architecture) -> keras.Model:
    """Build AlbedoNet: `masked_image` `(B, S, S, 3)` and compressed S `(B, S, S, 1)` → m_d, m_s.

    The output is `(B, 4)`: linear RGB diffuse albedo, in the hue of the object's pixels, then
    specular albedo, not yet clipped to [0, 1].
    """
    size = architecture.size
    masked_image = keras.Input((size, size, 3), name="masked_image")
    shading = keras.Input((size, size, 1), name="specular_shading")
    four_channels = layers.Concatenate(name="layers")([masked_image, shading])
    features = encoder(
        four_channels, width=architecture.encoder_width, dense_width=architecture.dense_width
    )
    albedos = layers.Dense(4, dtype="float32", name="albedos")(features)
    albedos = HueOfPixels(dtype="float32", name="hue")([albedos, masked_image])
    return keras.Model([masked_image, shading], albedos, name="albedo_net")


def _unet(x: keras.KerasTensor, architecture: Architecture, channels: int) -> keras.KerasTensor:
    return unet(x, width=architecture.unet_width, depth=architecture.unet_depth, channels=channels)
