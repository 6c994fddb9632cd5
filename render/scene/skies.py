"""Skies with a sun, by Mitsuba's model of daylight, over ground that they light."""

import math

import mitsuba as mi
import numpy as np

from lime_keras.optics import colour, environment

_ELEVATION_SINE = (0.02, 0.98)
"""Range of the sine of the sun's height above the horizon: uniform over the sky's area."""
_TURBIDITY = (1.5, 10.0)  # range of the turbidity, from a clear mountain sky to haze, log-uniform
_GROUND = (0.05, 0.6)  # range of the ground's albedo, from asphalt to old snow
_SUN_RADIUS = math.radians(0.5358 / 2)
_RINGS, _SECTORS = 32, 128
"""Numbers of samples of the sun's disc, from its centre outwards and around."""


def sample(rng: np.random.Generator, height: int) -> np.ndarray:
    """Draw a sky with a sun, and the ground below it; Mitsuba's variant must be set before.

    The ground is matte, even and lit by sky and sun, so it shines with albedo · E / π. The sun's
    energy is that of many directions inside its disc, each added to its texel, so it is exact
    although the disc is smaller than a texel.

    Returns:
        `(height, 2 * height)` float32 luminance, in the unit of Mitsuba's model: equirectangular,
        in the convention of `lime_keras.optics.environment`.
    """
    elevation = math.asin(rng.uniform(*_ELEVATION_SINE))
    azimuth = rng.uniform(-math.pi, math.pi)
    turbidity = math.exp(rng.uniform(*np.log(_TURBIDITY)))
    return sky(elevation, azimuth, turbidity, rng.uniform(*_GROUND), height)


def sky(
    elevation: float, azimuth: float, turbidity: float, albedo: float, height: int
) -> np.ndarray:
    """Return a sky with a sun, and the ground below it; see `sample`.

    Args:
        elevation: height of the sun above the horizon in radians, 0 … π/2.
        azimuth: angle of the sun around the vertical in radians.
        turbidity: haziness of the air, 1 … 10.
        albedo: albedo of the ground, 0 … 1.
        height: rows of the map; even.
    """
    sun = np.array(
        [
            math.cos(elevation) * math.sin(azimuth),
            math.sin(elevation),
            -math.cos(elevation) * math.cos(azimuth),
        ]
    )
    towards = environment.directions(height, 2 * height)
    solid_angle = environment.solid_angles(height, 2 * height)
    above = slice(0, height // 2)
    radiance = np.zeros((height, 2 * height))
    radiance[above] = _luminance(sun, turbidity, albedo, "sky", towards[above])
    disc, weight = _disc(sun)
    energy = _luminance(sun, turbidity, albedo, "sun", disc) * weight
    row = np.arccos(np.clip(disc[:, 1], -1, 1)) / math.pi * height
    column = np.arctan2(disc[:, 0], -disc[:, 2]) / (2 * math.pi) * 2 * height
    texel = (
        np.minimum(row.astype(int), height // 2 - 1),
        np.floor(column).astype(int) % (2 * height),
    )
    np.add.at(radiance, texel, energy / solid_angle[texel])
    irradiance = np.sum(radiance[above] * solid_angle[above] * towards[above][..., 1])
    radiance[height // 2 :] = albedo * irradiance / math.pi
    return radiance.astype(np.float32)


def _disc(sun: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return directions in the sun's disc, `(N, 3)`, and their solid angles, `(N,)` in steradians.

    What of the disc is below the horizon is left out.
    """
    ring = (np.arange(_RINGS) + 0.5) / _RINGS * _SUN_RADIUS
    sector = (np.arange(_SECTORS) + 0.5) / _SECTORS * 2 * math.pi
    aside = np.cross(sun, [1.0, 0, 0] if abs(sun[0]) < 0.5 else [0, 0, 1.0])
    aside /= np.linalg.norm(aside)
    radius, angle = (grid.ravel() for grid in np.meshgrid(ring, sector))
    around = np.cos(angle)[:, None] * aside + np.sin(angle)[:, None] * np.cross(sun, aside)
    directions = np.cos(radius)[:, None] * sun + np.sin(radius)[:, None] * around
    weight = np.sin(radius) * (_SUN_RADIUS / _RINGS) * (2 * math.pi / _SECTORS)
    up = directions[:, 1] > 0
    return directions[up], weight[up]


def _luminance(
    sun: np.ndarray, turbidity: float, albedo: float, part: str, towards: np.ndarray
) -> np.ndarray:
    """Return the luminance `(...)` of the `sky` or of the `sun` in directions `(..., 3)`."""
    emitter = mi.load_dict(
        {
            "type": "sunsky",
            "sun_direction": _in_mitsuba(sun).tolist(),
            "turbidity": turbidity,
            "albedo": {"type": "rgb", "value": [albedo] * 3},
            "sky_scale": float(part == "sky"),
            "sun_scale": float(part == "sun"),
        }
    )
    incoming = -_in_mitsuba(towards.reshape(-1, 3))

    def seen(direction) -> np.ndarray:
        surface = mi.SurfaceInteraction3f()
        surface.wi = mi.Vector3f(*direction)
        return np.array(emitter.eval(surface))

    if "scalar" in str(mi.variant()):
        rgb = np.array([seen(map(float, one)) for one in incoming]).reshape(-1, 3)
    else:
        rgb = seen(map(mi.Float, incoming.T.astype(np.float32))).reshape(3, -1).T
    return (rgb @ colour.LUMINANCE_WEIGHTS).reshape(towards.shape[:-1])


def _in_mitsuba(direction: np.ndarray) -> np.ndarray:
    """Turn directions `(..., 3)` into the emitter's frame, in which z is up."""
    x, y, z = np.moveaxis(direction, -1, 0)
    return np.stack([x, -z, y], axis=-1)
