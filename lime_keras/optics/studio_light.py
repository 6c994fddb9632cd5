"""The light of a studio, to show materials in; no corpus contains this light."""

import functools
import math

import numpy as np

from lime_keras.optics import environment

SOFT_BOXES = (
    ((-0.6, 0.6, 0.55), 22.0, 4.5),
    ((0.9, 0.1, 0.35), 16.0, 2.5),
    ((0.1, 0.9, -0.5), 18.0, 4.5),
)
"""Direction in camera space, not unit; angular radius in degrees; linear radiance."""


@functools.cache
def light() -> np.ndarray:
    """Return the studio's light in camera space, linear radiance `(64, 128)`, read-only.

    The light is three soft boxes of radiance 2.5 to 4.5 in a dark room.
    """
    height, width = environment.STORED_SHAPE
    towards = environment.directions(height, width)
    radiance = np.zeros((height, width))
    for direction, radius, strength in SOFT_BOXES:
        cosine = towards @ (np.array(direction) / np.linalg.norm(direction))
        radiance[cosine > math.cos(math.radians(radius))] = strength
    radiance.flags.writeable = False
    return radiance
