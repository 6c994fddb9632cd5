"""Fixtures that several test modules share."""

import dataclasses
import functools

import pytest

from lime_keras.render.mitsuba_setup import variants

# This must come before any import of Mitsuba, whose library is chosen here, and of TensorFlow,
# which crashes if it is imported before Mitsuba.
CHOICE = variants.choose()
variants.activate(CHOICE, threads=1)


@pytest.fixture(scope="session")
def mitsuba_choice():
    """Return the fastest variant of Mitsuba that works here; it is active, with one thread."""
    return CHOICE


@pytest.fixture(params=["eager", "compiled"])
def differentiate(request):
    """Return a function that computes values and gradients of functions, as NumPy arrays.

    `differentiate(function, *arrays)` returns `(value, [gradient, …])`: the value, and the gradient
    of the value's sum by each array.
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
    """Return the smallest architecture."""
    from lime_keras.networks import Architecture

    return Architecture(size=32, unet_width=2, unet_depth=2, encoder_width=2, dense_width=4)


@pytest.fixture(scope="session")
def tiny_model(tiny, tmp_path_factory):
    """Return the folder of an untrained tiny model; all its outputs vary with the image."""
    return _saved(tmp_path_factory.mktemp("tiny") / "model", tiny, seed=1)


ABLATIONS = {
    "without MirrorNet": {"mirror": False},
    "regression": {"exponent": "regression"},
    "baseline": {"system": "reflectance-map"},
}


@pytest.fixture(scope="session", params=ABLATIONS.values(), ids=ABLATIONS)
def ablation(request, tiny):
    """Return the smallest architecture of each ablation."""
    return dataclasses.replace(tiny, **request.param)


@pytest.fixture(scope="session")
def ablation_model(ablation, tmp_path_factory):
    """Return the folder of an untrained tiny model of each ablation (see `tiny_model`)."""
    return _saved(tmp_path_factory.mktemp("ablation") / "model", ablation, seed=3)


def _saved(folder, architecture, seed):
    """Save a model with random weights of a seed, chosen so that all outputs vary."""
    import keras

    from lime_keras.networks import build, weights

    keras.utils.set_random_seed(seed)
    subnetworks = build(architecture)
    # Untrained outputs are around 0, where mask and albedos are clipped: biases lift them.
    heads = {"segmentation": 0.6, "specular": 0.5, "mirror": 0.5, "reflectance_map": 0.5}
    for name, network in subnetworks.items():
        if name in heads:
            head = network.get_layer("head")
            head.bias.assign([heads[name]] * head.filters)
        elif name in ("albedo", "material"):
            network.get_layer("albedos").bias.assign([0.5] * 4)
    weights.save(folder, architecture, subnetworks)
    return folder
