"""A reference system in double precision, computed layer by layer.

Single and half precision are compared with it. Keras in float64 would not serve: the last layers of
the networks are built to compute in float32.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from keras import layers

from lime_keras.networks.blocks import HueOfPixels
from lime_keras.networks.guided_filter import GuidedFilter
from lime_keras.networks.registry import MASK_CONTRAST, SUBNETWORKS, is_plain
from lime_keras.optics.dichromatic import channels, with_hue_of_pixels
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
        terms = values.size / values.shape[-1]
        return self._moved(values, np.sqrt(terms))

    def answer(self, values: np.ndarray) -> np.ndarray:
        """Return a layer's output with random errors of ε."""
        return self._moved(values, 1.0)

    def _moved(self, values: np.ndarray, units: float) -> np.ndarray:
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
    if both := {"material", "trunk"}.intersection(subnetworks):
        exponent, albedos = run(both.pop())
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
    made = {id(tensor): x for tensor, x in zip(model.inputs, inputs, strict=True)}
    for layer in model.layers:
        if isinstance(layer, layers.InputLayer):
            continue
        given = layer.input if isinstance(layer.input, list) else [layer.input]
        answer = _LAYERS[type(layer)](layer, *[made[id(tensor)] for tensor in given], rounding)
        made[id(layer.output)] = rounding.answer(answer)
    found = [made[id(tensor)] for tensor in model.outputs]
    return found[0] if len(found) == 1 else found


def _convolution(layer: layers.Conv2D, x: np.ndarray, rounding: Rounding) -> np.ndarray:
    kernel, bias = _weights(layer, rounding)
    return _activated(layer, tf.nn.conv2d(x, kernel, layer.strides, "SAME").numpy() + bias)


def _depthwise(layer: layers.DepthwiseConv2D, x: np.ndarray, rounding: Rounding) -> np.ndarray:
    kernel, bias = _weights(layer, rounding)
    strides = (1, *layer.strides, 1)
    return _activated(layer, tf.nn.depthwise_conv2d(x, kernel, strides, "SAME").numpy() + bias)


def _dense(layer: layers.Dense, x: np.ndarray, rounding: Rounding) -> np.ndarray:
    kernel, bias = _weights(layer, rounding)
    return _activated(layer, x @ kernel + bias)


def _weights(layer: keras.Layer, rounding: Rounding) -> tuple[np.ndarray, np.ndarray]:
    kernel, bias = (np.asarray(weight, np.float64) for weight in layer.get_weights())
    return rounding.weights(kernel), bias


def _activated(layer: Any, x: np.ndarray) -> np.ndarray:
    name = layer.activation.__name__
    limits = {"relu": (0, None), "relu6": (0, 6), "linear": (None, None)}
    return np.clip(x, *limits[name])


def _turned(
    layer: HueOfPixels, albedos: np.ndarray, image: np.ndarray, rounding: Rounding
) -> np.ndarray:
    diffuse = with_hue_of_pixels(albedos[:, :3], image)
    return np.concatenate([diffuse, albedos[:, 3:]], axis=-1)


def _filtered(
    layer: GuidedFilter, mask: np.ndarray, image: np.ndarray, rounding: Rounding
) -> np.ndarray:
    # It takes small variances, so rounding errors of the mask and of the colours count.
    return np.asarray(layer.call([rounding.answer(mask), rounding.answer(image)]))


def _pooled(layer: layers.MaxPooling2D, x: np.ndarray, rounding: Rounding) -> np.ndarray:
    count, height, width, channels = x.shape
    return x.reshape(count, height // 2, 2, width // 2, 2, channels).max((2, 4))


_LAYERS: dict[type, Callable[..., np.ndarray]] = {
    layers.Add: lambda layer, one, other, rounding: one + other,
    layers.Conv2D: _convolution,
    layers.DepthwiseConv2D: _depthwise,
    layers.Dense: _dense,
    GuidedFilter: _filtered,
    HueOfPixels: _turned,
    layers.MaxPooling2D: _pooled,
    layers.UpSampling2D: lambda layer, x, rounding: x.repeat(2, 1).repeat(2, 2),
    layers.Concatenate: lambda layer, *xs: np.concatenate(xs[:-1], axis=-1),
    layers.Flatten: lambda layer, x, rounding: x.reshape(len(x), -1),
    layers.Rescaling: lambda layer, x, rounding: x * layer.scale + layer.offset,
    layers.Reshape: lambda layer, x, rounding: x.reshape(len(x), *layer.target_shape),
}
"""Functions that compute each kind of layer in the networks, by class of the layer."""
