"""Small test images of every mask and level, and references for functions of images."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from lime_keras.eval.stability.verdicts import Outcome, joined

from .precisions import ROUNDINGS, Precision

HEIGHT, WIDTH = 4, 5
PIXELS = HEIGHT * WIDTH

Slopes = list[tuple[np.ndarray, np.ndarray, np.ndarray]]
"""For each argument: the least and the greatest correct derivative, and its magnitude."""
Reference = Callable[..., tuple[np.ndarray, np.ndarray, Slopes]]
"""Function from a precision and rounded arguments to values, their magnitudes, and slopes."""


@functools.cache
def masks() -> dict[str, np.ndarray]:
    """Return masks `(4, 5, 1)` of coverage in [0, 1] by name."""
    full = np.ones((HEIGHT, WIDTH, 1))
    one = np.zeros_like(full)
    one[1, 2] = 1.0
    return {"empty": 0 * full, "one-pixel": one, "faint one-pixel": one / 255, "full": full}


def judged(
    function: Callable[..., Any], reference: Reference, precision: Precision, *arguments: np.ndarray
) -> Outcome:
    """Compare a function and its gradients by its arguments with a reference.

    Gradients are compared for the first arguments, as many as the reference has slopes for.
    """
    found, gradients = precision.evaluate(function, *arguments)
    right, size, slopes = reference(precision, *map(precision.rounded, arguments))
    value = precision.compare(found, right, right, size, terms=PIXELS)
    if not gradients:
        return Outcome(value)
    by_argument = [
        precision.compare(gradient, *slope, terms=PIXELS)
        for gradient, slope in zip(gradients, slopes, strict=False)
    ]
    return Outcome(value, joined(by_argument))


def fields(levels: Any) -> np.ndarray:
    """Return an uneven image `(B, 4, 5, 1)` for each of B levels."""
    pattern = np.random.default_rng(0).uniform(0.5, 1, (HEIGHT, WIDTH, 1))
    # The level is exact at two pixels, one of which the one-pixel mask covers.
    pattern[0, 0] = pattern[1, 2] = 1.0
    return np.reshape(levels, (-1, 1, 1, 1)) * pattern


def repeated(mask: np.ndarray, count: int) -> np.ndarray:
    """Repeat a mask `(H, W, 1)` for `count` examples, `(count, H, W, 1)`."""
    return np.broadcast_to(mask, (count, *mask.shape))


def pairs(first: Any, second: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return all pairs of a value of `first` and a value of `second`, as two arrays `(N,)`."""
    a, b = np.meshgrid(first, second, indexing="ij")
    return a.ravel(), b.ravel()


def signs(
    difference: np.ndarray, size: np.ndarray, precision: Precision
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest derivative of |difference| that rounding allows.

    Both signs are allowed where the difference is 0 to within rounding.
    """
    doubtful = np.abs(difference) <= ROUNDINGS * (precision.epsilon * size + precision.least)
    return np.where(doubtful, -1, np.sign(difference)), np.where(doubtful, 1, np.sign(difference))
