"""The laws from which scenes are drawn, as `scenes` draws them."""

from collections.abc import Callable

import numpy as np

from lime_keras.optics import colour

from ..scene.sampling import FILL

Law = Callable[[np.ndarray], np.ndarray]
"""Distribution function: share of the values at or below each argument."""


def uniform(low: float, high: float) -> Law:
    """The law of equal shares between two values."""
    return lambda value: np.clip((value - low) / (high - low), 0, 1)


def yuv(channel: int) -> Law:
    """Of Y, U or V of colours uniform in the RGB cube, which uniform in YUV amounts to.

    The transform is linear, so equal volumes stay equal; the cube is what rejection leaves.
    """
    steps = (np.arange(40) + 0.5) / 40
    cube = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    values = np.sort(colour.rgb_to_yuv(cube)[:, channel])
    shares = (np.arange(len(values)) + 0.5) / len(values)
    return lambda value: np.interp(value, values, shares)


def shift(value: np.ndarray) -> np.ndarray:
    """Law of the object's place: uniform in what its size, itself uniform, leaves of the frame."""
    slack = (1 - np.linspace(*FILL, 201)) / 2
    return np.mean(uniform(-1, 1)(np.asarray(value)[..., None] / slack), axis=-1)
