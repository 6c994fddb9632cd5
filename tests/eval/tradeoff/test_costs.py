"""Arithmetic against counts by hand."""

import dataclasses

import keras
import pytest
from keras import layers

from lime_keras.eval.tradeoff.costs import flop
from lime_keras.networks import SUBNETWORKS, assemble, build


def test_a_convolution_and_a_dense_layer():
    """A kernel that is not square, strides that leave 3 × 2 positions, pooling that is free."""
    image = keras.Input((6, 8, 5))
    x = layers.Conv2D(7, (3, 2), strides=(2, 4), padding="same")(image)
    x = layers.Flatten()(layers.MaxPooling2D((3, 1))(x))
    assert x.shape == (None, 14)
    network = keras.Model(image, layers.Dense(11)(x))
    assert flop(network) == 2 * (3 * 2 * 5 * 7) * (3 * 2) + 2 * 14 * 11


def test_a_depthwise_convolution_and_a_normalisation_that_is_free():
    """Two answers a channel, 4 × 4 positions."""
    image = keras.Input((4, 4, 3))
    x = layers.DepthwiseConv2D((3, 1), depth_multiplier=2, padding="same")(image)
    network = keras.Model(image, layers.BatchNormalization()(x))
    assert network.output_shape == (None, 4, 4, 6)
    assert flop(network) == 2 * (3 * 1) * 6 * 16


def test_a_u_net_by_hand(tiny):
    """Widths 2, 4, 8 at 32, 16, 8 pixels; one channel in and out."""
    down = 32**2 * 9 * (1 * 2 + 2 * 2) + 16**2 * 9 * (2 * 4 + 4 * 4)
    bottom = 8**2 * 9 * (4 * 8 + 8 * 8)
    up = 16**2 * 9 * (12 * 4 + 4 * 4) + 32**2 * 9 * (6 * 2 + 2 * 2) + 32**2 * 2
    assert flop(SUBNETWORKS["mirror"].build(dataclasses.replace(tiny, unet_depth=2))) == 2 * (
        down + bottom + up
    )


def test_an_encoder_by_hand(tiny):
    """Widths 2, 4, 8, 16, 16 from 32 pixels down to 1; dense layers of 4, 4 and 8 units."""
    blocks = [(32, 2, 2), (16, 2, 4), (8, 4, 8), (4, 8, 16), (2, 16, 16)]
    convolutions = sum(9 * side**2 * below * width for side, below, width in blocks)
    assert flop(SUBNETWORKS["exponent"].build(tiny)) == 2 * (convolutions + 16 * 4 + 4 * 4 + 4 * 8)


def test_the_whole_system_is_the_sum_of_its_parts(tiny):
    subnetworks = build(tiny)
    assert flop(assemble(subnetworks)) == sum(map(flop, subnetworks.values()))


def test_a_layer_it_cannot_count_is_not_taken_as_free():
    image = keras.Input((4, 4, 3))
    network = keras.Model(image, layers.Conv2DTranspose(2, 3, name="wider")(image))
    with pytest.raises(ValueError, match="wider is a Conv2DTranspose"):
        flop(network)
