"""EfficientNet-Lite0 without its classifier: the encoder of a pretrained SegmentationNet.

Tan and Le, EfficientNet (ICML 2019); "Lite" has no squeeze-and-excitation, and ReLU6 throughout.
`lime_keras.train.backbone` reads the weights. The normalisation of each convolution is folded into
its kernel and bias, so that a trained network has nothing to fold.
"""

from keras import KerasTensor, layers

PREFIX = "lite0"  # beginning of the names of all layers
STEM = 32  # channels of the first convolution
STAGES = (
    (1, 16, 1, 1, 3),
    (6, 24, 2, 2, 3),
    (6, 40, 2, 2, 5),
    (6, 80, 3, 2, 3),
    (6, 112, 3, 1, 5),
    (6, 192, 4, 2, 5),
    (6, 320, 1, 1, 3),
)
"""Expansion, channels, number of blocks, stride of the first block, and kernel of each stage."""


def features(image: KerasTensor) -> list[KerasTensor]:
    """Return the features of an image at strides 2, 4, 8, 16 and 32.

    Args:
        image: sRGB in [0, 1], `(B, H, W, 3)`; H and W divisible by 32.

    Returns:
        Features `(B, H / stride, W / stride, C)` with 16, 24, 40, 112 and 320 channels.
    """
    # The classifier saw (255 x − 127) / 128.
    x = layers.Rescaling(255 / 128, -127 / 128, name=f"{PREFIX}_scale")(image)
    x = layers.Conv2D(
        STEM, 3, strides=2, padding="same", activation="relu6", name=f"{PREFIX}_stem"
    )(x)
    out: list[KerasTensor] = []
    block = 0
    for expansion, channels, count, stride, kernel in STAGES:
        if stride == 2:
            out.append(x)
        for index in range(count):
            x = _block(x, block, expansion, channels, stride if index == 0 else 1, kernel)
            block += 1
    return [*out, x]


def _block(
    x: KerasTensor, number: int, expansion: int, channels: int, stride: int, kernel: int
) -> KerasTensor:
    """Apply an inverted bottleneck: expand, filter each channel, project; add x where it fits."""
    name, inner, wide = f"{PREFIX}_block{number}", x.shape[-1] * expansion, x
    if expansion > 1:
        wide = layers.Conv2D(inner, 1, activation="relu6", name=f"{name}_expand")(x)
    wide = layers.DepthwiseConv2D(
        kernel, strides=stride, padding="same", activation="relu6", name=f"{name}_depthwise"
    )(wide)
    narrow = layers.Conv2D(channels, 1, name=f"{name}_project")(wide)
    if stride == 1 and x.shape[-1] == channels:
        narrow = layers.Add(name=f"{name}_add")([x, narrow])
    return narrow
