"""The system under test, and the photos that it is tested with."""

import functools
import tempfile
from pathlib import Path
from typing import Any

import keras
import numpy as np
import tensorflow as tf

from lime_keras.export import exporter
from lime_keras.model import weights
from lime_keras.networks import Architecture, assemble, build
from lime_keras.networks.precision import computing_in
from lime_keras.runtime import onnx_graphs
from lime_keras.runtime.engine import Answering
from lime_keras.runtime.saved_model import SavedModel

from . import double_precision
from .precisions import ROUNDINGS, Precision
from .verdicts import Compared, joined

BATCH = 64
_DRAWS = 4
_MARGIN = 4.0  # factor by which an error may exceed the largest of `_DRAWS` random rounding errors
Answers = dict[str, np.ndarray]


def extreme_photos(side: int) -> dict[str, np.ndarray]:
    """Return extreme photos `(side, side, 3)`, sRGB in [0, 1], by name.

    They are black, white, constant, with one odd pixel, chequered, and a 16-bit ramp.
    """
    lit = np.zeros((side, side, 3))
    lit[side // 2, side // 3] = 1.0
    dark = 1 - lit
    board = np.indices((side, side)).sum(0) % 2 * np.ones((3, 1, 1))
    ramp = np.arange(side * side * 3).reshape(side, side, 3) % 65536 / 65535
    return {
        "black": np.zeros_like(lit),
        "white": np.ones_like(lit),
        "constant": np.full_like(lit, 0.5),
        "one pixel lit": lit,
        "one pixel dark": dark,
        "chequered": np.moveaxis(board, 0, -1),
        "in steps of 16 bits": ramp,
    }


class TrialSystem:
    """A system in every precision and format; each variant is made when it is first needed."""

    def __init__(self, folder: Path):
        self.folder = folder

    @functools.cached_property
    def _scratch(self) -> Path:
        """A temporary folder that is deleted when the process ends."""
        self._temporary = tempfile.TemporaryDirectory(prefix="lime-stability-")
        return Path(self._temporary.name)

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
        """The names of 63 images, and the batch `(64, S, S, 3)` of them and an image of NaN.

        All images are repeated in turn; the image of NaN comes last.
        """
        names = [list(self.images)[k % len(self.images)] for k in range(BATCH - 1)]
        photos = [self.images[name] for name in names]
        return names, np.stack([*photos, np.full_like(photos[0], np.nan)])

    def answers(self, precision: Precision, batch: np.ndarray) -> Answers:
        """Return the network's outputs for images `(B, S, S, 3)` in a precision."""
        found = self._network(precision)(tf.constant(batch, tf.float32))
        return {name: np.asarray(x).astype(np.float64) for name, x in found.items()}

    def exact(self, image: str) -> Answers:
        """Return the outputs in double precision for one of `images`."""
        return self._exact(0.0, 0)[image]

    def tolerance(self, image: str, epsilon: float) -> Answers:
        """Return the tolerance of each output for one of `images` in a precision.

        The tolerance is the largest change by random rounding errors times `_MARGIN`. The error of
        the formulas after the networks is added; they compute in single precision in every case.
        """
        exact, out = self.exact(image), {}
        draws = [self._exact(epsilon, seed)[image] for seed in range(1, _DRAWS + 1)]
        for name, right in exact.items():
            moved = max(np.max(np.abs(draw[name] - right)) for draw in draws)
            formula = ROUNDINGS * 2.0**-23 * (1 + np.abs(right))
            out[name] = _MARGIN * moved + formula
        return out

    def compared(self, image: str, found: Answers, epsilon: float) -> Compared:
        """Compare all outputs for one of `images` with those in double precision, joined into one.

        Raises:
            ValueError: if these are other outputs.
        """
        right, tolerance = self.exact(image), self.tolerance(image, epsilon)
        if set(found) != set(right):
            raise ValueError(f"answers {sorted(found)}, expected {sorted(right)}")
        return joined(Compared(found[name], x, x, tolerance[name]) for name, x in right.items())

    def steepest(self, precision: Precision) -> np.ndarray:
        """Return the largest absolute derivative of the mean outputs by each weight tensor, `(W,)`.

        The means are taken over all images and added up over the outputs.
        """
        network = self._network(precision)
        batch = tf.stack(list(self.images.values()))
        with tf.GradientTape() as tape:
            answer = network(batch, training=False)
            total = sum(tf.reduce_mean(x) for x in answer.values())
        gradients = tape.gradient(total, [v.value for v in network.trainable_variables])
        return np.array([np.max(np.abs(np.float64(g))) for g in gradients])

    @functools.cache  # noqa: B019 - lives as long as the suite runs
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
        """Return the function of images in a precision; without XLA or a format, a Keras model."""
        if precision.format:
            exporter.export(self._scratch, precision.format, self.folder)
            path = exporter.target(self._scratch, precision.format)
            onnx = precision.format == exporter.ONNX
            engine: Answering = onnx_graphs.open_file(path) if onnx else SavedModel(path)
            return lambda batch: engine.run(engine.outputs, {"image": np.asarray(batch)})
        architecture, trained = self._loaded
        with computing_in(precision.dtype):
            subnetworks = build(architecture)
        for name, one in subnetworks.items():
            one.set_weights(trained[name].get_weights())
        network = assemble(subnetworks)
        if not precision.compiled:
            return network
        return tf.function(lambda batch: network(batch, training=False), jit_compile=True)
