"""Functions of small images, shown every mask and level, and judged by hand-made references."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from .precisions import ROUNDINGS, Precision
from .verdicts import Outcome, joined

HEIGHT, WIDTH = 4, 5
PIXELS = HEIGHT * WIDTH

Slopes = list[tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Of each argument, the least and most that a derivative may be, and its size."""
Reference = Callable[..., tuple[np.ndarray, np.ndarray, Slopes]]
"""From a precision and rounded arguments to values, their sizes, and slopes."""


@functools.cache
def masks() -> dict[str, np.ndarray]:
    """Coverages `(4, 5, 1)` by name."""
    full = np.ones((HEIGHT, WIDTH, 1))
    one = np.zeros_like(full)
    one[1, 2] = 1.0
    return {"empty": 0 * full, "one-pixel": one, "faint one-pixel": one / 255, "full": full}


def judged(
    function: Callable[..., Any], reference: Reference, precision: Precision, *arguments: np.ndarray
) -> Outcome:
    """A function and its gradients by its arguments, as far as the reference has them."""
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
    """An uneven image `(B, 4, 5, 1)` of each of B levels."""
    pattern = np.random.default_rng(0).uniform(0.5, 1, (HEIGHT, WIDTH, 1))
    # Where the one-pixel mask looks too, the level is exact.
    pattern[0, 0] = pattern[1, 2] = 1.0
    return np.reshape(levels, (-1, 1, 1, 1)) * pattern


def repeated(mask: np.ndarray, count: int) -> np.ndarray:
    """One mask for each example."""
    return np.broadcast_to(mask, (count, *mask.shape))


def pairs(first: Any, second: Any) -> tuple[np.ndarray, np.ndarray]:
    """Each of the first with each of the second, in two rows."""
    a, b = np.meshgrid(first, second, indexing="ij")
    return a.ravel(), b.ravel()


def signs(
    difference: np.ndarray, size: np.ndarray, precision: Precision
) -> tuple[np.ndarray, np.ndarray]:
    """Least and most that the derivative of |difference| may be; either sign where it is 0."""
    doubtful = np.abs(difference) <= ROUNDINGS * (precision.epsilon * size + precision.least)
    return np.where(doubtful, -1, np.sign(difference)), np.where(doubtful, 1, np.sign(difference))
