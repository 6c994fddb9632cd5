"""The layers of EfficientNet-Lite0; its pretrained weights are tested in tests/train."""

import keras
import numpy as np

from lime_keras.networks import efficientnet


def test_features_halve_the_image_five_times():
    image = keras.Input((64, 96, 3))
    found = [tuple(x.shape[1:]) for x in efficientnet.features(image)]
    assert found == [(32, 48, 16), (16, 24, 24), (8, 12, 40), (4, 6, 112), (2, 3, 320)]


def test_it_has_the_weights_of_its_publication():
    """4,652,008 parameters, less those of the head and two for each normalised channel."""
    image = keras.Input((32, 32, 3))
    network = keras.Model(image, efficientnet.features(image))
    head = 320 * 1280 + 2 * 1280 + 1280 * 1000 + 1000
    convolutions = [layer for layer in network.layers if layer.weights]
    channels = sum(layer.output.shape[-1] for layer in convolutions)
    # A folded convolution has a bias, where the published one has a scale and a shift.
    assert network.count_params() + channels == 4_652_008 - head


def test_residual_blocks_add_what_they_read():
    """With its last convolution at zero, a block of equal width passes its input on."""
    image = keras.Input((32, 32, 3))
    efficientnet_features = efficientnet.features(image)
    network = keras.Model(image, efficientnet_features)
    adds = [layer for layer in network.layers if layer.name.endswith("_add")]
    assert len(adds) == sum(count - 1 for _, _, count, _, _ in efficientnet.STAGES)
    block = network.get_layer("lite0_block2_project")
    block.set_weights([0 * value for value in block.get_weights()])
    inner = keras.Model(image, [adds[0].input[0], adds[0].output])
    one, other = inner(np.random.default_rng(0).uniform(0, 1, (1, 32, 32, 3)).astype("float32"))
    np.testing.assert_array_equal(one, other)
