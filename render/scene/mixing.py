"""The maps of mixed lights: environment maps, added up and lit with lamps."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lime_keras.optics import environment

from . import environments
from .light_law import Lamp, LightDraw

LEAST_ROWS = 256  # least number of rows of a mixture: a texel is then as wide as the smallest lamps
_SMALLEST = 0.65
"""Least half length and half width of a lamp, in texels: it covers a texel's middle."""
_COARSE_ROWS = 16


class Map(NamedTuple):
    """An environment map to mix: radiance `(H, 2 H)` of spherical mean 1, and where it is strong.

    `azimuth` is that of its strongest light in radians, of the texel of 11° with most energy.
    """

    radiance: np.ndarray
    azimuth: float


def as_map(radiance: np.ndarray) -> Map:
    """Return a map to mix.

    Args:
        radiance: `(H, W)`, W about 2 H, finite and at least 0; not 0 everywhere.
    """
    height = min(len(radiance), radiance.shape[1] // 2)
    radiance = _sized(radiance, height)
    coarse = _sized(radiance, _COARSE_ROWS) * environment.solid_angles(_COARSE_ROWS, 32)
    strongest = int(np.argmax(coarse)) % (2 * _COARSE_ROWS)
    azimuth = (strongest + 0.5) * math.pi / _COARSE_ROWS
    return Map((radiance / environment.spherical_mean(radiance)).astype(np.float32), azimuth)


def mixed(maps: Sequence[Map], light: LightDraw) -> np.ndarray:
    """Mix a light: the sum of its maps, each mirrored and turned, and of its lamps.

    The mixture has as many rows as its largest map, at least `LEAST_ROWS`; smaller maps are
    enlarged by repeating their texels. The power of a lamp is divided among the texels that it
    covers, so it is right wherever the lamp falls between them. A lamp's edge is at least a texel
    wide, and a lamp smaller than 1.3 texels is widened to that.

    Args:
        maps: the maps that `light.maps` names, in that order.
        light: the light, from `light_law.draw`.

    Returns:
        Linear radiance `(H, 2 H)` float32, of spherical mean 1.
    """
    height = max(LEAST_ROWS, *(len(one.radiance) for one in maps))
    total = np.zeros((height, 2 * height), np.float32)
    for one, power, target, mirror in zip(
        maps, light.powers, light.azimuths, light.mirrored, strict=True
    ):
        radiance, azimuth = _sized(one.radiance, height), one.azimuth
        if mirror:
            radiance, azimuth = radiance[:, ::-1], 2 * math.pi - azimuth
        columns = round((target - azimuth) * height / math.pi)
        total += np.float32(power) * np.roll(radiance, columns, axis=1)
    for lamp in light.lamps:
        rows, lit = _lit(lamp, height)
        energy = lit * environment.solid_angles(height, 2 * height)[rows]
        total[rows] += np.float32(4 * math.pi * lamp.power / energy.sum(dtype=float)) * lit
    return total


def _sized(radiance: np.ndarray, height: int) -> np.ndarray:
    """Return a map of `height` rows with the same light: texels repeated, then averaged."""
    rows = min(len(radiance), radiance.shape[1] // 2)
    repeats = -(-height // rows)
    if repeats > 1:
        radiance = radiance.repeat(repeats, axis=0).repeat(repeats, axis=1)
    if radiance.shape == (height, 2 * height):
        return radiance
    return environments.resized(radiance, height).astype(np.float32, "C")


def _lit(lamp: Lamp, height: int) -> tuple[slice, np.ndarray]:
    """Return the rows that a lamp reaches, and its radiance there over its largest, `(R, 2 H)`.

    The distance to a lamp's border is measured in the plane that touches the sphere at the lamp's
    middle, and is multiplied by the cosine of the angle from the middle. This saves a division,
    keeps the border, where the distance is 0, and makes it positive all over the far hemisphere:
    only the soft edge of a canopy reaches there.
    """
    # The rows: those within the angle of the farthest corner, with its edge.
    texel = math.pi / height
    length, breadth = (max(half, _SMALLEST * texel) for half in lamp.half)
    edge = max(lamp.softness, texel)
    polar = math.acos(min(max(lamp.towards[1], -1.0), 1.0))
    reach = math.atan(math.hypot(length, breadth)) + edge + 2 * texel
    if reach > math.pi / 4:
        reach = math.pi
    first, last = math.floor((polar - reach) / texel), math.ceil((polar + reach) / texel)
    rows = slice(max(first, 0), min(last, height))
    # The distances along and across from the middle.
    z = _cosine(lamp.towards, height, rows)
    x = np.abs(_cosine(lamp.across, height, rows))
    y = np.abs(_cosine(np.cross(lamp.towards, lamp.across), height, rows))
    corner = lamp.roundness * breadth
    beyond_x, beyond_y = x - (length - corner) * z, y - (breadth - corner) * z
    outside = np.hypot(np.maximum(beyond_x, 0), np.maximum(beyond_y, 0))
    inside = np.minimum(np.maximum(beyond_x, beyond_y), 0)
    lit = np.clip(0.5 - (outside + inside - corner * z) / edge, 0, 1)
    if lamp.bar:
        for distance, at in zip((x, y), lamp.bars_at, strict=True):
            lit *= np.clip(0.5 + (np.abs(distance - at * z) - lamp.bar) / edge, 0, 1)
    return rows, lit


def _cosine(direction: np.ndarray, height: int, rows: slice) -> np.ndarray:
    """Return the cosines `(R, 2 H)` float32 between a direction and those of a map's texels.

    A texel's direction is made of parts of its row and of its column (`environment.directions`), so
    a cosine takes one multiplication and one addition.
    """
    x, y, z = direction.astype(np.float32)
    polar = (np.arange(height, dtype=np.float32)[rows, None] + 0.5) * np.float32(math.pi / height)
    azimuth = (np.arange(2 * height, dtype=np.float32) + 0.5) * np.float32(math.pi / height)
    return np.sin(polar) * (np.sin(azimuth) * x - np.cos(azimuth) * z) + np.cos(polar) * y
