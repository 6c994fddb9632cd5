"""The arithmetic of a network for one image, and the paper's run times."""

import math

import keras

TITAN_XP = {
    "segmentation": 2.83,
    "specular": 3.30,
    "mirror": 2.99,
    "albedo": 2.68,
    "exponent": 1.92,
}
"""The paper's run times of its subnetworks on a Titan Xp, milliseconds for one image."""

_COUNTED = keras.layers.Conv2D | keras.layers.DepthwiseConv2D | keras.layers.Dense


def flop(network: keras.Model) -> int:
    """Count the multiplications and additions of convolutions and dense layers for one image.

    Biases are not counted. A batch normalisation counts as 0: for inference it is folded into the
    convolution before it.

    Raises:
        ValueError: if a layer of another kind holds weights.
    """
    total = 0
    for layer in network.layers:
        if isinstance(layer, keras.Model):
            total += flop(layer)
        elif isinstance(layer, _COUNTED):
            positions = math.prod(layer.output.shape[1:-1])
            total += 2 * math.prod(layer.kernel.shape) * positions
        elif layer.weights and not isinstance(layer, keras.layers.BatchNormalization):
            kind = type(layer).__name__
            raise ValueError(f"{network.name}/{layer.name} is a {kind}: count its arithmetic too")
    return total
