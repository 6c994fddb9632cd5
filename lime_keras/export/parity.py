"""The parity check of a written model with Keras: its test images and its tolerances."""

from collections.abc import Collection

import numpy as np
import tensorflow as tf

from lime_keras.export.quantisation import relative_error
from lime_keras.runtime.engine import Answering, Arrays

TOLERANCE = 1e-3
"""Largest accepted difference in float32: absolute, but relative for values above 1."""
GROSS = {"float16": 0.05, "int8": 0.5}
"""Largest accepted `quantisation.relative_error` of an output in fewer bits.

Beyond these limits a model is broken; whether a smaller loss is acceptable is the user's choice.
float16 has 11 significant bits. An output of zeros has an error of 1; int8 may have half of that.
"""
_BATCH = 4


class ParityError(RuntimeError):
    """A difference between a written model and Keras that is too large."""


def images(size: int) -> np.ndarray:
    """Return images `(8, size, size, 3)` sRGB in [0, 1]: two shaded balls, then extreme images.

    The extreme images are smooth, noisy, black, white, of one colour, and with one lit pixel. The
    balls, one dull and one shiny, are needed because a trained mask is empty without an object.
    With an empty mask the other outputs would agree although nothing was compared.
    """
    rng = np.random.default_rng(0)
    coarse = rng.uniform(size=(1, 8, 8, 3)).astype(np.float32)
    smooth = np.array(tf.image.resize(coarse, (size, size)))[0]
    noisy = rng.uniform(size=(size, size, 3)).astype(np.float32)
    black, white = np.zeros_like(noisy), np.ones_like(noisy)
    colour = white * np.array([0.8, 0.5, 0.2], np.float32)
    lit = black.copy()
    lit[size // 3, size // 2] = 1
    balls = [_ball(size, exponent) for exponent in (3.0, 300.0)]
    return np.stack([*balls, smooth, noisy, black, white, colour, lit])


def _ball(size: int, exponent: float) -> np.ndarray:
    """Return a lit ball with a highlight, before stripes, `(size, size, 3)` in [0, 1]."""
    x, y = np.meshgrid(*[np.linspace(-1.25, 1.25, size)] * 2)
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    towards_light = np.maximum(0.4 * x - 0.5 * y + 0.77 * z, 0)[..., None]
    highlight = np.maximum(0.21 * x - 0.27 * y + 0.94 * z, 0)[..., None] ** exponent
    ball = np.array([0.5, 0.3, 0.2]) * towards_light + 0.5 * highlight
    stripes = 0.4 + 0.2 * np.sin(12 * x + 5 * y)[..., None] * np.array([1.0, 0.5, -1.0])
    return np.clip(np.where(z[..., None] > 0, ball, stripes), 0, 1).astype(np.float32)


def predictions(
    engine: Answering,
    images: np.ndarray,
    outputs: Collection[str] | None = None,
    masks: np.ndarray | None = None,
) -> dict[str, np.ndarray]:
    """Return an engine's outputs for all images: for the first alone, then in batches of several.

    Args:
        engine: engine of the model.
        images: images `(N, S, S, 3)`, sRGB in [0, 1].
        outputs: names of the outputs; by default all of the engine's.
        masks: masks `(N, S, S, 1)` in [0, 1] that the subnetworks read in place of the predicted
            ones.
    """
    names = engine.outputs if outputs is None else outputs
    inputs = {"image": images} | ({} if masks is None else {"mask": masks})
    batches = np.split(np.arange(len(images)), range(1, len(images), _BATCH))
    answers = [
        engine.run(names, {name: values[batch] for name, values in inputs.items()})
        for batch in batches
    ]
    return {name: np.concatenate([one[name] for one in answers]) for name in names}


def check_against(
    keras_engine: Answering,
    images: np.ndarray,
    outputs: Collection[str],
    predicted: Arrays,
    precision: str,
) -> dict[str, float]:
    """Return the difference between a written model and Keras for each output (see `check`).

    In float32 Keras reads the mask that the written model predicted: the split of colours is of all
    pixels with a mask above 0, and rounding may take in one more, which moves all other outputs.

    Args:
        keras_engine: the Keras model in float32.
        images: images `(N, S, S, 3)`, sRGB in [0, 1].
        outputs: names of the outputs that the written model must have.
        predicted: its outputs for the images.
        precision: its precision: `float32`, `float16` or `int8`.
    """
    others = [name for name in outputs if name != "mask"]
    if precision != "float32" or "mask" not in predicted or len(others) in (0, len(outputs)):
        return check(predictions(keras_engine, images, outputs), predicted, precision)
    expected = predictions(keras_engine, images, ["mask"])
    if predicted["mask"].shape == expected["mask"].shape:
        expected |= predictions(keras_engine, images, others, predicted["mask"])
    return check(expected, predicted, precision)


def check(expected: Arrays, predicted: Arrays, precision: str) -> dict[str, float]:
    """Return the difference between a written model and Keras for each output, by name.

    Args:
        expected: outputs of the Keras model in float32.
        predicted: outputs of the written model for the same images.
        precision: precision of the written model: `float32`, `float16` or `int8`.

    Returns:
        In float32 the largest difference, relative where the expected value is above 1; else
        `quantisation.relative_error`.

    Raises:
        ParityError: if names or shapes differ, a value is not finite, or the difference is beyond
            `TOLERANCE` or `GROSS`.
    """
    shapes = {name: value.shape for name, value in expected.items()}
    others = {name: value.shape for name, value in predicted.items()}
    if shapes != others:
        raise ParityError(f"outputs {others}, expected {shapes}")
    limit = TOLERANCE
    differences = {
        name: float(np.max(np.abs(predicted[name] - value) / np.maximum(np.abs(value), 1)))
        for name, value in expected.items()
    }
    if not np.all(np.isfinite(list(differences.values()))):
        raise ParityError(f"the written model's answers are not finite: {differences}")
    if precision != "float32":
        differences, limit = relative_error(expected, predicted), GROSS[precision]
    if wrong := {name: value for name, value in differences.items() if value > limit}:
        raise ParityError(
            f"the written model differs from Keras: {wrong}; in {precision} it may by {limit}"
        )
    return differences
