"""Cases for the hue of an object's pixels: grey, black, clipped, faint and missing ones."""

import functools
from typing import Any

import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import colour, dichromatic

from .. import srgb_standard
from ..precisions import NUMPY_DOUBLE, NUMPY_SINGLE, ROUNDINGS, SINGLE, XLA, Precision

_SIDE = 6
_LEAST_CHROMA = 1e-3  # mean chroma below which an image has no hue


def _images() -> dict[str, np.ndarray]:
    """Return masked images `(6, 6, 3)`, sRGB, by name."""
    whole = np.ones((_SIDE, _SIDE, 3))
    one = np.zeros_like(whole)
    one[2, 3] = 1.0
    top = np.zeros_like(whole)
    top[:3] = 1.0
    orange = np.array([0.8, 0.5, 0.1])
    steps = np.linspace(0.2, 1.0, _SIDE)[:, None, None]
    return {
        "black": 0 * whole,
        "grey": 0.5 * whole,
        "white": whole,
        "all clipped in red": np.where(np.arange(3) == 0, 1.0, 0.3) * whole,
        "orange": orange * steps * whole,
        "one orange pixel": orange * one,
        "half orange, half clipped": np.where(top > 0, orange, [1.0, 0.2, 0.2]),
        "blue of one level": np.array([0.0, 0.0, 1 / 255]) * whole,
        "orange and its complement": np.where(top > 0, orange, orange[::-1]),
    }


_ALBEDOS = {
    "black": (0.0, 0.0, 0.0),
    "grey": (0.5, 0.5, 0.5),
    "red": (0.7, 0.1, 0.05),
    "out of range": (-30.0, 30.0, 0.5),
}


def cases() -> list[Case]:
    """Return the cases of the hue."""
    return [
        Case(
            "hue of pixels",
            f"{image}, {albedo} albedo",
            precision.name,
            functools.partial(_turned, _images()[image], _ALBEDOS[albedo], precision),
        )
        for image in _images()
        for albedo in _ALBEDOS
        for precision in (SINGLE, XLA, NUMPY_SINGLE, NUMPY_DOUBLE)
    ]


def _with_hue(albedo: Any, image: Any) -> Any:
    return dichromatic.with_hue_of_pixels(albedo, image)


def _turned(image: np.ndarray, albedo: tuple[float, ...], precision: Precision) -> Outcome:
    """Try an albedo's hue; the chroma has no sum, so that of the gradients is 1 for each channel.

    Colours are differences of channels: rounding errors of the channels count beside the mean
    chroma, to which the albedo's own is turned.
    """
    found, gradients = precision.evaluate(_with_hue, np.array([albedo]), image[None])
    own, pixels = precision.rounded(np.array(albedo)), precision.rounded(image).reshape(-1, 3)
    brightest = pixels.max(-1)
    linear = srgb_standard.decoded(pixels)
    # A function of single precision turns doubles, too: a chroma is cut off at float32's zero.
    usable = (brightest > 0) & (brightest < colour.CLIPPED)
    chroma = (linear - linear.mean(-1, keepdims=True)) * usable[:, None]
    mean = chroma.sum(0) / max(usable.sum(), 1)
    length, grey = np.linalg.norm(mean), own.mean()
    strength = np.linalg.norm(own - grey)
    size = np.abs(own).max() * np.ones(3)
    right = own
    if length > _LEAST_CHROMA:
        right = grey + strength * mean / length
        size = size + strength * linear.max() / length
    # A chroma's length is at least 1e-10, so that it has a gradient.
    floor = 1.001e-10 * np.abs(mean) / max(length, _LEAST_CHROMA)
    tolerance = precision.tolerance(size, terms=len(pixels)) + floor
    value = Compared(found[0], right, right, tolerance)
    if not gradients:
        return Outcome(value)
    steep = ROUNDINGS * (4 + linear.max() / max(length, _LEAST_CHROMA))
    gradient = Compared(gradients[0], 1.0, 1.0, steep * precision.epsilon)
    return Outcome(value, gradient)
