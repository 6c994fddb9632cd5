"""The maps of drawn lights: a bank's maps, mixed and lit up with lamps, on any device.

They are computed in `keras.ops`; or in NumPy, without Keras, if the arguments are NumPy arrays.
"""

import math
from typing import Any

import numpy as np

from lime_keras.arrays import namespace
from lime_keras.optics import environment

from .light_law import LAMP_PARTS, LAMPS, MAPS, LightDraw

_SMALLEST = 0.65
"""Least half length and half width of a lamp over a texel's height: it covers a texel's middle."""
_LEAST = 1e-30
"""Least divisor, so that a light of zeros stays one."""


def mixed(radiance: Any, light: LightDraw) -> Any:
    """Mix the lights of a batch of scenes: Σ weight · map, mirrored and rolled, + Σ lamps.

    The power of a lamp is divided among the texels that it covers, so it is right wherever the lamp
    falls between them. A lamp's edge is at least a texel wide, and a lamp smaller than 1.3 texels
    is widened to that. The sum is scaled to the spherical mean `environment.MEAN_RADIANCE`, which
    the rounding of the maps to half floats had left by some 1e-4. A light whose maps are 0 and that
    has no lamps stays 0.

    Args:
        radiance: the maps of a bank as they are stored, linear radiance, `(N, H, W)` float16 or
            float32, finite and at least 0.
        light: the lights of the batch, from `light_law.draw`.

    Returns:
        Linear radiance in the map's frame, `(B, H, W)` float32.
    """
    _, height, width = radiance.shape
    xp = namespace(radiance, *light)
    total = _maps(radiance, light, xp)
    for index in range(LAMPS):
        lamp = {name: light.lamps[:, index, part] for name, part in LAMP_PARTS.items()}
        lit = _lit(lamp, height, width, xp)
        strength = lamp["power"] / xp.maximum(_mean(lit, xp), _LEAST)[:, None]
        total = total + strength[..., None] * lit
    exposure = environment.MEAN_RADIANCE / xp.maximum(_mean(total, xp), _LEAST)
    return total * exposure[:, None, None]


def _maps(radiance: Any, light: LightDraw, xp: Any) -> Any:
    """Return the mixture of the maps alone, `(B, H, W)`."""
    _, height, width = radiance.shape
    column = xp.mod(np.arange(width, dtype=np.int32) - light.shifts[..., None], width)
    column = xp.where(light.mirrored[..., None], width - 1 - column, column)
    row = np.arange(height, dtype=np.int32)[:, None] * width
    texels = xp.reshape(radiance, (-1,))
    total: Any = 0.0
    for index in range(MAPS):
        first = light.maps[:, index, None] * (height * width) + column[:, index]
        found = xp.take(texels, first[:, None, :] + row, axis=0)
        total = total + xp.multiply(light.weights[:, index, None, None], found)
    return total


def _lit(lamp: dict[str, Any], height: int, width: int, xp: Any) -> Any:
    """Return the radiance of lamps over their largest, `(B, H, W)` in [0, 1].

    The distance to a lamp's border is measured in the plane that touches the sphere at the lamp's
    middle, and is multiplied by the cosine of the angle from the middle. This saves a division,
    keeps the border, where the distance is 0, and makes it positive all over the far hemisphere:
    only the soft edge of a canopy reaches there.
    """
    texel = math.pi / height
    forth, along = lamp["towards"], lamp["across"]
    z = _cosine(forth, height, width)
    x = xp.abs(_cosine(along, height, width))
    y = xp.abs(_cosine(_cross(forth, along, xp), height, width))
    half = xp.maximum(lamp["half"], _SMALLEST * texel)
    length, breadth = half[:, 0, None, None], half[:, 1, None, None]
    corner = lamp["roundness"][..., None] * breadth
    sharpness = 1.0 / xp.maximum(lamp["softness"], texel)[..., None]
    beyond_x, beyond_y = x - (length - corner) * z, y - (breadth - corner) * z
    outside = xp.sqrt(xp.square(xp.maximum(beyond_x, 0.0)) + xp.square(xp.maximum(beyond_y, 0.0)))
    inside = xp.minimum(xp.maximum(beyond_x, beyond_y), 0.0)
    lit = xp.clip(0.5 - (outside + inside - corner * z) * sharpness, 0.0, 1.0)
    bars_x, bars_y = (
        xp.abs(distance - lamp["bars_at"][:, axis, None, None] * z)
        - lamp["bars_half"][:, axis, None, None]
        for axis, distance in enumerate((x, y))
    )
    lit = lit * xp.clip(0.5 + bars_x * sharpness, 0.0, 1.0)
    return lit * xp.clip(0.5 + bars_y * sharpness, 0.0, 1.0)


def _cosine(direction: Any, height: int, width: int) -> Any:
    """Return the cosines `(B, H, W)` between directions `(B, 3)` and those of a map's texels.

    A texel's direction is made of parts of its row and of its column (`environment.directions`), so
    a cosine takes one multiplication and one addition.
    """
    polar = (np.arange(height, dtype=np.float32)[:, None] + 0.5) * (math.pi / height)
    azimuth = (np.arange(width, dtype=np.float32) + 0.5) * (2 * math.pi / width)
    x, y, z = (direction[:, axis, None, None] for axis in range(3))
    return np.sin(polar) * (np.sin(azimuth) * x - np.cos(azimuth) * z) + np.cos(polar) * y


def _cross(a: Any, b: Any, xp: Any) -> Any:
    """Return the cross products `(B, 3)` of vectors `(B, 3)`."""
    turned = [(a[:, i] * b[:, j] - a[:, j] * b[:, i]) for i, j in ((1, 2), (2, 0), (0, 1))]
    return xp.stack(turned, axis=1)


def _mean(radiance: Any, xp: Any) -> Any:
    """Return the spherical means `(B,)` of maps `(B, H, W)`, summed by rows first for accuracy."""
    _, height, width = radiance.shape
    share = environment.solid_angles(height, width)[:, 0].astype(np.float32) / (4 * math.pi)
    return xp.sum(xp.sum(radiance, axis=2) * share, axis=1)
