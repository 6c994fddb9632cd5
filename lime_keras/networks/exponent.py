"""ExponentNet: specular shading S and mirror image M → the exponent."""

import keras
from keras import layers

from lime_keras.networks.architecture import Architecture
from lime_keras.networks.blocks import encoder
from lime_keras.optics.shininess import BIN_COUNT, LOG_HIGH, LOG_LOW


def exponent_net(architecture: Architecture) -> keras.Model:
    """Compressed S and M, `(B, S, S, 1)` each → `(B, 8)` probabilities of the bins.

    Without a MirrorNet S alone is its input; under regression it answers log10 s, `(B, 1)`.
    """
    size = architecture.size
    names = ["specular_shading", "mirror"] if architecture.mirror else ["specular_shading"]
    inputs = [keras.Input((size, size, 1), name=name) for name in names]
    seen = layers.Concatenate(name="layers")(inputs) if architecture.mirror else inputs[0]
    features = encoder(seen, width=architecture.encoder_width, dense_width=architecture.dense_width)
    if architecture.exponent == "regression":
        # From the middle on: a bias of 0 is the dullest material there is.
        middle = keras.initializers.Constant((LOG_LOW + LOG_HIGH) / 2)
        answer = layers.Dense(1, dtype="float32", bias_initializer=middle, name="log_exponent")(
            features
        )
    else:
        logits = layers.Dense(BIN_COUNT, dtype="float32", name="logits")(features)
        answer = layers.Softmax(dtype="float32", name="exponent_bin_probabilities")(logits)
    return keras.Model(inputs, answer, name="exponent_net")
