"""Fixtures that several modules share."""

import functools

import pytest

from lime_keras.render import variants

# Before anything imports Mitsuba, whose library is chosen here, or TensorFlow, which crashes if it
# comes first.
CHOICE = variants.choose()
variants.activate(CHOICE, threads=1)


@pytest.fixture(scope="session")
def mitsuba_choice():
    """The fastest variant of Mitsuba that works here, active, with one thread."""
    return CHOICE


@pytest.fixture(params=["eager", "compiled"])
def differentiate(request):
    """A function's value and its gradient by each argument, as NumPy arrays.

    `differentiate(function, *arrays)` gives `(value, [gradient, …])`, each gradient that of the
    value's sum.
    """
    import tensorflow as tf

    @functools.cache
    def differentiated(function):
        def run(*variables):
            with tf.GradientTape() as tape:
                tape.watch(variables)
                value = function(*variables)
            gradients = tape.gradient(
                value, variables, unconnected_gradients=tf.UnconnectedGradients.ZERO
            )
            return value, gradients

        return tf.function(run) if request.param == "compiled" else run

    def evaluate(function, *arrays):
        value, gradients = differentiated(function)(*map(tf.constant, arrays))
        return value.numpy(), [gradient.numpy() for gradient in gradients]

    return evaluate


@pytest.fixture(scope="session")
def tiny():
    """The smallest architecture."""
    from lime_keras.networks import Architecture

    return Architecture(size=32, unet_width=2, unet_depth=2, encoder_width=2, dense_width=4)


@pytest.fixture(scope="session")
def tiny_model(tiny, tmp_path_factory):
    """Folder of an untrained tiny model whose every output varies with the image."""
    import keras

    from lime_keras import weights
    from lime_keras.networks import build

    folder = tmp_path_factory.mktemp("tiny") / "model"
    keras.utils.set_random_seed(1)
    subnetworks = build(tiny)
    # The heads start around zero, where the mask and the albedos are clipped.
    subnetworks["segmentation"].get_layer("head").bias.assign([0.6])
    subnetworks["specular"].get_layer("head").bias.assign([0.5])
    subnetworks["mirror"].get_layer("head").bias.assign([0.5])
    subnetworks["albedo"].get_layer("albedos").bias.assign([0.5] * 4)
    weights.save(folder, tiny, subnetworks)
    return folder
