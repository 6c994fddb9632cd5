"""The building blocks of the subnetworks: U-Net, encoder, and the baseline's decoder."""

from typing import Any

from keras import KerasTensor, layers, ops

from lime_keras.networks.architecture import ENCODER_BLOCKS
from lime_keras.networks.efficientnet import features
from lime_keras.optics.dichromatic import with_hue_of_pixels

PLAIN_HEAD = "plain_head"
"""Name of the last layer of a network whose images are read as they are: a mask that is not
stretched, S and M in linear radiance."""
_PRETRAINED_WIDTHS = (16, 32, 64, 96, 128)
"""Channels of the decoder behind EfficientNet-Lite0 at strides 1, 2, 4, 8 and 16."""


def _convolution(x: KerasTensor, width: int, name: str) -> KerasTensor:
    """Apply a 3×3 convolution with ReLU, zero padding and He initialisation."""
    return layers.Conv2D(
        width, 3, padding="same", activation="relu", kernel_initializer="he_normal", name=name
    )(x)


def convolutions(x: KerasTensor, width: int, name: str) -> KerasTensor:
    """Apply two 3×3 convolutions with ReLU."""
    return _convolution(_convolution(x, width, f"{name}_conv1"), width, f"{name}_conv2")


def unet(x: KerasTensor, *, width: int, depth: int, head: str) -> KerasTensor:
    """Apply a U-Net whose skip connections concatenate.

    Args:
        x: `(B, H, W, C)`; H and W divisible by `2 ** depth`.
        width: channels of the first level; each level below doubles the channels, to at most eight
            times this number.
        depth: number of levels below the first.
        head: name of the last layer, which says how its numbers are read (`registry.PLAIN_HEAD`).

    Returns:
        `(B, H, W, 1)`, linear (no activation function), float32.
    """
    widths = [width * min(2**level, 8) for level in range(depth + 1)]
    skips = []
    for level in range(depth):
        x = convolutions(x, widths[level], f"down{level}")
        skips.append(x)
        x = layers.MaxPooling2D(name=f"pool{level}")(x)
    x = convolutions(x, widths[depth], "bottom")
    for level in reversed(range(depth)):
        # Not bilinear: XLA cannot compile the mixed-precision gradient of bilinear upsampling.
        x = layers.UpSampling2D(interpolation="nearest", name=f"up{level}")(x)
        x = layers.Concatenate(name=f"skip{level}")([x, skips[level]])
        x = convolutions(x, widths[level], f"up{level}")
    # Linear: with a softplus head the output became all black in training
    # (docs/explanation/decisions.md).
    return layers.Conv2D(1, 1, dtype="float32", name=head)(x)


def pretrained_unet(image: KerasTensor) -> KerasTensor:
    """Apply a U-Net whose encoder is EfficientNet-Lite0, with one convolution a level behind it.

    Args:
        image: sRGB in [0, 1], `(B, H, W, 3)`; H and W divisible by 32.

    Returns:
        `(B, H, W, 1)`, linear (no activation function), float32; 0 before training.
    """
    stem = _convolution(image, 16, "stem")
    *skips, x = [stem, *features(image)]
    for level, width in reversed(list(enumerate(_PRETRAINED_WIDTHS))):
        x = layers.UpSampling2D(interpolation="nearest", name=f"up{level}")(x)
        x = layers.Concatenate(name=f"skip{level}")([x, skips[level]])
        x = _convolution(x, width, f"up{level}_conv")
    return layers.Conv2D(1, 1, kernel_initializer="zeros", dtype="float32", name="head")(x)


def encoder(x: KerasTensor, *, width: int, dense_width: int) -> KerasTensor:
    """Apply five blocks of convolution, ReLU and max-pooling, then two dense layers with ReLU.

    Args:
        x: `(B, H, W, C)`; H and W divisible by 32.
        width: channels of the first block; each later block doubles the channels, to at most eight
            times this number.
        dense_width: units of each dense layer.

    Returns:
        `(B, dense_width)` features. The caller adds the last dense layer, the head.
    """
    for block in range(ENCODER_BLOCKS):
        x = _convolution(x, width * min(2**block, 8), f"block{block}_conv")
        x = layers.MaxPooling2D(name=f"block{block}_pool")(x)
    x = layers.Flatten(name="flatten")(x)
    for index in (1, 2):
        x = layers.Dense(
            dense_width, activation="relu", kernel_initializer="he_normal", name=f"dense{index}"
        )(x)
    return x


class HueOfPixels(layers.Layer):
    """A layer that turns m_d, the first three of `(B, 4)` albedos, to the hue of a masked image.

    Its inputs are the albedos and the image `(B, H, W, 3)`, sRGB (`optics.dichromatic`).
    """

    def call(self, inputs: list[Any]) -> Any:
        """Return the albedos `(B, 4)`, m_d turned."""
        albedos, masked_image = inputs
        diffuse = with_hue_of_pixels(albedos[:, :3], masked_image)
        return ops.concatenate([diffuse, albedos[:, 3:]], axis=-1)


def decoder(features: KerasTensor, *, size: int, width: int) -> KerasTensor:
    """Apply the reverse of `encoder`: a dense layer, five blocks of upsampling and convolution.

    Args:
        features: `(B, F)`.
        size: height and width of the output in pixels; divisible by 32.
        width: channels of the last block; each block before has twice the channels, to at most
            eight times this number.

    Returns:
        `(B, size, size, 3)`, linear (no activation function), float32.
    """
    side = size // 2**ENCODER_BLOCKS
    widths = [width * min(2**block, 8) for block in range(ENCODER_BLOCKS)]
    x = layers.Dense(
        side**2 * widths[-1],
        activation="relu",
        kernel_initializer="he_normal",
        name="decoder_dense",
    )(features)
    x = layers.Reshape((side, side, widths[-1]), name="decoder_reshape")(x)
    for block in reversed(range(ENCODER_BLOCKS)):
        x = layers.UpSampling2D(interpolation="nearest", name=f"decoder{block}_up")(x)
        x = _convolution(x, widths[block], f"decoder{block}_conv")
    return layers.Conv2D(3, 1, dtype="float32", name="head")(x)
