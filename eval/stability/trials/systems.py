"""A system to drive to its edges: a trained one, or a small one with fresh weights."""

import dataclasses
import functools
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import keras
import numpy as np
import tensorflow as tf

from lime_keras.arrays import Answer
from lime_keras.estimate.estimator import Estimator
from lime_keras.export import exporter, formats
from lime_keras.networks import Architecture, assemble, build, weights
from lime_keras.networks.precision import computing_in

from . import double_precision
from .photos import extreme_photos
from .precisions import ROUNDINGS, Precision

_SMALL = Architecture(size=32, unet_width=4, unet_depth=1, encoder_width=4, dense_width=8)
FRESH = {"LIME": _SMALL, "baseline": dataclasses.replace(_SMALL, system="reflectance-map")}
"""Systems small enough to be tried in seconds."""

BATCH = 64
_DRAWS = 4
_MARGIN = 4.0
"""Times the largest change in a few draws that rounding is allowed to make."""
# A mask, shading and albedos inside their range, or all that follows would be 0.
_HEADS = {"segmentation": 0.6, "specular": 0.5, "mirror": 0.5, "reflectance_map": 0.5}

Answers = dict[str, np.ndarray]


class TrialSystem:
    """A system in every precision and format, each made when it is first asked for.

    Args:
        source: run of `lime-train` or folder of `weights.save`, or an architecture whose weights
            are drawn.
    """

    def __init__(self, source: Path | Architecture):
        self._source = source

    @functools.cached_property
    def _scratch(self) -> Path:
        """A folder that goes with this object."""
        self._temporary = tempfile.TemporaryDirectory(prefix="lime-stability-")
        return Path(self._temporary.name)

    @functools.cached_property
    def folder(self) -> Path:
        """Of the weights."""
        if isinstance(self._source, Path):
            return self._source
        weights.save(self._scratch / "model", self._source, _drawn(self._source))
        return self._scratch / "model"

    @functools.cached_property
    def _loaded(self) -> tuple[Architecture, dict[str, keras.Model]]:
        return weights.load(self.folder)

    @functools.cached_property
    def images(self) -> dict[str, np.ndarray]:
        """Extreme photos `(S, S, 3)` by name, float32 sRGB in [0, 1]."""
        size = self._loaded[0].size
        return {name: image.astype(np.float32) for name, image in extreme_photos(size).items()}

    @functools.cached_property
    def batch(self) -> tuple[list[str], np.ndarray]:
        """All images over and over, `(64, S, S, 3)`, the last of NaN; and names of the others."""
        names = [list(self.images)[k % len(self.images)] for k in range(BATCH - 1)]
        photos = [self.images[name] for name in names]
        return names, np.stack([*photos, np.full_like(photos[0], np.nan)])

    @functools.cached_property
    def estimator(self) -> Estimator:
        """What answers the public interface."""
        return Estimator(self.folder)

    def answers(self, precision: Precision, batch: np.ndarray) -> Answers:
        """The network's, for `(B, S, S, 3)`."""
        return _numpy(self._network(precision)(tf.constant(batch, tf.float32)))

    @functools.cache  # noqa: B019 - lives as long as the suite runs
    def served_batch(self, model_format: str) -> Answers:
        """The exported model's answers to `batch`."""
        return self.served(model_format, self.batch[1])

    def served(self, model_format: str, batch: np.ndarray) -> Answers:
        """The exported model's, for `(B, S, S, 3)`."""
        return _numpy(self._exported(model_format)(batch.astype(np.float32)))

    def exact(self, image: str) -> Answers:
        """In double precision, to one of `images`."""
        return self._exact(0.0, 0)[image]

    def tolerance(self, image: str, epsilon: float) -> Answers:
        """How far rounding may move each answer: what random rounding does, and somewhat more.

        To that come the formulas behind the networks, in single precision whatever they compute in.
        """
        exact, out = self.exact(image), {}
        draws = [self._exact(epsilon, seed)[image] for seed in range(1, _DRAWS + 1)]
        for name, right in exact.items():
            moved = max(np.max(np.abs(draw[name] - right)) for draw in draws)
            formula = ROUNDINGS * 2.0**-23 * (1 + np.abs(right))
            out[name] = _MARGIN * moved + formula
        return out

    def steepest(self, precision: Precision) -> np.ndarray:
        """The largest derivative of all images' mean answers by each of the networks' weights."""
        network = self._network(precision)
        batch = tf.stack(list(self.images.values()))
        with tf.GradientTape() as tape:
            answer = network(batch, training=False)
            total = sum(tf.reduce_mean(x) for x in answer.values())
        gradients = tape.gradient(total, [v.value for v in network.trainable_variables])
        return np.array([np.max(np.abs(np.float64(g))) for g in gradients])

    @functools.cache  # noqa: B019 - as above
    def _exact(self, epsilon: float, seed: int) -> dict[str, Answers]:
        rounding = double_precision.Rounding(epsilon, np.random.default_rng(seed))
        photos = np.stack(list(self.images.values()))
        found = double_precision.answers(self._loaded[1], photos, rounding)
        return {
            image: {name: x[k : k + 1] for name, x in found.items()}
            for k, image in enumerate(self.images)
        }

    @functools.cache  # noqa: B019 - as above
    def _network(self, precision: Precision) -> Any:
        architecture, subnetworks = self._loaded
        if precision.dtype != "float32":
            subnetworks = _computing_in(precision.dtype, architecture, subnetworks)
        network = assemble(subnetworks)
        if not precision.compiled:
            return network
        return tf.function(lambda batch: network(batch, training=False), jit_compile=True)

    @functools.cache  # noqa: B019 - as above
    def _exported(self, model_format: str) -> Answer:
        """The exported model, opened."""
        exporter.export(self._scratch, model_format, self.folder)
        path = exporter.target(self._scratch, model_format)
        if model_format == exporter.ONNX:
            return formats.open_onnx(path)
        return formats.open_saved_model(path)[formats.SERVED]


def _drawn(architecture: Architecture) -> dict[str, keras.Model]:
    """Subnetworks with weights of a fixed seed that leave nothing black."""
    subnetworks = build(architecture, seed=0)
    for name, network in subnetworks.items():
        if name in _HEADS:
            bias = network.get_layer("head").bias
            bias.assign(np.full(bias.shape, _HEADS[name]))
        elif name in ("albedo", "material"):
            network.get_layer("albedos").bias.assign([0.5] * 4)
    return subnetworks


def _computing_in(
    precision: str, architecture: Architecture, subnetworks: Mapping[str, keras.Model]
) -> dict[str, keras.Model]:
    """The same weights in networks that compute otherwise."""
    with computing_in(precision):
        out = build(architecture)
    for name, network in out.items():
        network.set_weights(subnetworks[name].get_weights())
    return out


def _numpy(answer: Mapping[str, Any]) -> Answers:
    return {name: np.asarray(x).astype(np.float64) for name, x in answer.items()}
