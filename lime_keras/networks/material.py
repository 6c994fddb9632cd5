"""MaterialNet of the baseline: reflectance map → albedos and class of the exponent."""

import keras
from keras import layers

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import encoder
from lime_keras.optics.shininess import BIN_COUNT


def material_net(architecture: Architecture) -> keras.Model:
    """Compressed reflectance map `(B, S, S, 3)` → `(B, 4)` m_d and m_s, `(B, 8)` probabilities.

    The albedos are linear and not yet clipped to [0, 1].
    """
    size = architecture.size
    sphere = keras.Input((size, size, 3), name="reflectance_map")
    features = encoder(
        sphere, width=architecture.encoder_width, dense_width=architecture.dense_width
    )
    albedos = layers.Dense(4, dtype="float32", name="albedos")(features)
    logits = layers.Dense(BIN_COUNT, dtype="float32", name="logits")(features)
    probabilities = layers.Softmax(dtype="float32", name="exponent_bin_probabilities")(logits)
    return keras.Model(sphere, [albedos, probabilities], name="material_net")
