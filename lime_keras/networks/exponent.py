"""ExponentNet: specular shading S and mirror image M → class of the exponent."""

import keras
from keras import layers

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import encoder
from lime_keras.shininess import BIN_COUNT


def exponent_net(architecture: Architecture) -> keras.Model:
    """Compressed S and M, `(B, S, S, 1)` each → `(B, 8)` probabilities."""
    size = architecture.size
    shading = keras.Input((size, size, 1), name="specular_shading")
    mirror = keras.Input((size, size, 1), name="mirror")
    both = layers.Concatenate(name="layers")([shading, mirror])
    features = encoder(both, width=architecture.encoder_width, dense_width=architecture.dense_width)
    logits = layers.Dense(BIN_COUNT, dtype="float32", name="logits")(features)
    probabilities = layers.Softmax(dtype="float32", name="exponent_bin_probabilities")(logits)
    return keras.Model([shading, mirror], probabilities, name="exponent_net")
