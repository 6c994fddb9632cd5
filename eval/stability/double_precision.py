"""A reference system in double precision, computed layer by layer.

Single and half precision are compared with it. Each layer is built anew in float64, whatever the
precision of the network's own is.
"""

import functools
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import keras
import numpy as np
from keras import layers

from lime_keras.networks.blocks import HueOfPixels
from lime_keras.networks.guided_filter import GuidedFilter
from lime_keras.networks.registry import MASK_CONTRAST, SUBNETWORKS, is_plain
from lime_keras.optics.dichromatic import channels
from lime_keras.optics.dynamic_range import HIGHEST_COMPRESSED
from lime_keras.optics.reflectance_map import disc
from lime_keras.optics.shininess import LOG_HIGH, LOG_LOW


@dataclass(frozen=True)
class Rounding:
    """Random rounding errors of a precision, to measure their effect on a system's outputs.

    The rounding error of a sum of N products is modelled as a relative error of √N ε in each
    weight. Each layer's output has a relative error of ε.

    Attributes:
        epsilon: machine epsilon of the precision; 0 makes no errors.
        rng: random generator of the errors.
    """

    epsilon: float
    rng: np.random.Generator

    def weights(self, values: np.ndarray) -> np.ndarray:
        """Return a layer's weights `(..., outputs)` with random errors of √N ε."""
        return self.answer(values, np.sqrt(values.size / values.shape[-1]))

    def answer(self, values: np.ndarray, units: float = 1.0) -> np.ndarray:
        """Return a layer's output with random errors of ε, or of as many `units` of it."""
        if self.epsilon == 0:
            return values
        return values * (1 + units * self.epsilon * self.rng.uniform(-0.5, 0.5, values.shape))


EXACT = Rounding(0.0, np.random.default_rng(0))


def answers(
    subnetworks: Mapping[str, keras.Model], images: np.ndarray, rounding: Rounding = EXACT
) -> dict[str, np.ndarray]:
    """Compute the outputs of `lime_keras.networks.assemble` in float64.

    Args:
        subnetworks: all subnetworks of a system, by name.
        images: `(B, S, S, 3)` sRGB in [0, 1].
        rounding: random errors to make at each layer.
    """
    images = np.asarray(images, np.float64)

    def run(name: str) -> Any:
        network = subnetworks[name]
        return _run(network, [inputs[tensor.name] for tensor in network.inputs], rounding)

    inputs = {"image": images}
    contrast = 1 if is_plain(subnetworks["segmentation"]) else MASK_CONTRAST
    mask = np.clip(contrast * (run("segmentation") - 0.5) + 0.5, 0, 1)
    inputs |= {"masked_image": images * mask, "dichromatic": channels(images, mask)}
    out = {"mask": mask}
    shapes = {"specular": mask, "mirror": mask, "reflectance_map": disc(images.shape[1])}
    for name in filter(subnetworks.__contains__, shapes):
        [quantity] = SUBNETWORKS[name].predicts
        raw = run(name)
        if is_plain(subnetworks[name]):
            raw = np.log1p(np.maximum(raw, 0))
        inputs[quantity] = raw * shapes[name]
        out[quantity] = np.expm1(np.clip(inputs[quantity], 0, HIGHEST_COMPRESSED))
        inputs[f"linear_{quantity}"] = out[quantity]
    if "material" in subnetworks:
        exponent, albedos = run("material")
    else:
        exponent, albedos = run("exponent"), run("albedo")
    albedos = np.clip(albedos, 0, 1)
    out |= {"diffuse_albedo": albedos[:, :3], "specular_albedo": albedos[:, 3:]}
    if exponent.shape[-1] == 1:
        return out | {"log_exponent": np.clip(exponent, LOG_LOW, LOG_HIGH)}
    powers = np.exp(exponent - exponent.max(-1, keepdims=True))
    return out | {"exponent_bin_probabilities": powers / powers.sum(-1, keepdims=True)}


def _run(model: keras.Model, inputs: Collection[np.ndarray], rounding: Rounding) -> Any:
    """Return the output of a functional model, or its outputs as a list."""
    tensors = {id(tensor): x for tensor, x in zip(model.inputs, inputs, strict=True)}
    for layer in model.layers:
        if isinstance(layer, layers.InputLayer):
            continue
        read = layer.input if isinstance(layer.input, list) else [layer.input]
        answer = _answer(layer, [tensors[id(tensor)] for tensor in read], rounding)
        tensors[id(layer.output)] = rounding.answer(answer)
    outputs = [tensors[id(tensor)] for tensor in model.outputs]
    return outputs[0] if len(outputs) == 1 else outputs


def _answer(layer: keras.Layer, inputs: list[np.ndarray], rounding: Rounding) -> np.ndarray:
    """Return a layer's output in float64, with random errors in its weights."""
    if isinstance(layer, GuidedFilter):
        # It takes small variances, so rounding errors of the mask and of the colours count.
        inputs = [rounding.answer(x) for x in inputs]
    if isinstance(layer, GuidedFilter | HueOfPixels):  # these compute in their inputs' precision
        return np.asarray(layer.call(inputs))
    given = inputs if len(inputs) > 1 else inputs[0]
    double = _in_double(layer)
    if not double.built:
        double(given)
    weights = [np.asarray(x, np.float64) for x in layer.get_weights()]
    double.set_weights([rounding.weights(x) if x.ndim > 1 else x for x in weights])
    return np.asarray(double(given))


@functools.cache
def _in_double(layer: keras.Layer) -> keras.Layer:
    """Return a layer like another one, but of float64, without its weights."""
    return type(layer).from_config(layer.get_config() | {"dtype": "float64"})
