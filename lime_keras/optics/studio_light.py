"""The light of a studio, to show materials in; no corpus contains this light."""

import functools
import math

import numpy as np

from lime_keras.optics import environment

Light = tuple[tuple[float, float, float], float, float]

LIGHTS: tuple[Light, ...] = (
    ((-0.25, 0.7, 0.6), 80.0, 0.42),
    ((-0.6, 0.6, 0.55), 7.0, 45.0),
    *(((0.9, height, 0.35), 6.0, 3.0) for height in (-0.15, 0.0, 0.15, 0.3, 0.45)),
)
"""Direction in camera space, not unit; angular radius in degrees; linear radiance.

A wide dim fill, before it a small hard lamp, and a strip of discs at the right. The lamp is as
small as the lobes of glossy materials and far brighter than white, so that a specular albedo of
0.05 shows: matte at s = 20, satin at 60, glazed at 250. A white of 0.75 stays below white.
"""


@functools.cache
def light(lights: tuple[Light, ...] = LIGHTS) -> np.ndarray:
    """Return a studio's light in camera space, linear radiance `(64, 128)`, read-only.

    Args:
        lights: discs of light as in `LIGHTS`; a later one hides those before it.
    """
    height, width = environment.STORED_SHAPE
    towards = environment.directions(height, width)
    radiance = np.zeros((height, width))
    for direction, radius, strength in lights:
        cosine = towards @ (np.array(direction) / np.linalg.norm(direction))
        radiance[cosine > math.cos(math.radians(radius))] = strength
    radiance.flags.writeable = False
    return radiance
