"""The families of networks: U-Nets, encoders, and the decoder of the reflectance-map baseline."""

from keras import KerasTensor, layers

from lime_keras.networks.architecture import ENCODER_BLOCKS


def convolutions(x: KerasTensor, width: int, name: str) -> KerasTensor:
    """Two 3×3 convolutions with ReLU, zero-padded, He initialisation."""
    for index in (1, 2):
        x = layers.Conv2D(
            width,
            3,
            padding="same",
            activation="relu",
            kernel_initializer="he_normal",
            name=f"{name}_conv{index}",
        )(x)
    return x


def unet(x: KerasTensor, *, width: int, depth: int, channels: int) -> KerasTensor:
    """U-Net with skip concatenation; linear, at the input's height and width.

    Args:
        x: `(B, H, W, C)`; H and W divisible by `2 ** depth`.
        width: channels of the first level; each level down doubles them, up to eight times.
        depth: levels below the first.
        channels: of the answer, `(B, H, W, channels)`.
    """
    widths = [width * min(2**level, 8) for level in range(depth + 1)]
    skips = []
    for level in range(depth):
        x = convolutions(x, widths[level], f"down{level}")
        skips.append(x)
        x = layers.MaxPooling2D(name=f"pool{level}")(x)
    x = convolutions(x, widths[depth], "bottom")
    for level in reversed(range(depth)):
        # Nearest, not bilinear: XLA cannot compile the mixed-precision gradient of the latter.
        x = layers.UpSampling2D(interpolation="nearest", name=f"up{level}")(x)
        x = layers.Concatenate(name=f"skip{level}")([x, skips[level]])
        x = convolutions(x, widths[level], f"up{level}")
    # Linear: a softplus head here died to all black (docs/decisions.md).
    return layers.Conv2D(channels, 1, dtype="float32", name="head")(x)


def encoder(x: KerasTensor, *, width: int, dense_width: int) -> KerasTensor:
    """Five blocks of convolution, ReLU and max-pooling, then two dense layers with ReLU.

    Args:
        x: `(B, H, W, C)`; H and W divisible by 32.
        width: channels of the first block; each next one doubles them, up to eight times.
        dense_width: units of each dense layer.

    Returns:
        `(B, dense_width)` features; the caller adds the third dense layer, its head.
    """
    for block in range(ENCODER_BLOCKS):
        x = layers.Conv2D(
            width * min(2**block, 8),
            3,
            padding="same",
            activation="relu",
            kernel_initializer="he_normal",
            name=f"block{block}_conv",
        )(x)
        x = layers.MaxPooling2D(name=f"block{block}_pool")(x)
    x = layers.Flatten(name="flatten")(x)
    for index in (1, 2):
        x = layers.Dense(
            dense_width, activation="relu", kernel_initializer="he_normal", name=f"dense{index}"
        )(x)
    return x


def decoder(features: KerasTensor, *, size: int, width: int, channels: int) -> KerasTensor:
    """The mirror of `encoder`: a dense layer, then five blocks of upsampling and convolution.

    Args:
        features: `(B, F)`.
        size: height and width of the answer; divisible by 32.
        width: channels of the last block; each one before doubles them, up to eight times.
        channels: of the answer, `(B, size, size, channels)`, which is linear.
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
        x = layers.Conv2D(
            widths[block],
            3,
            padding="same",
            activation="relu",
            kernel_initializer="he_normal",
            name=f"decoder{block}_conv",
        )(x)
    return layers.Conv2D(channels, 1, dtype="float32", name="head")(x)
