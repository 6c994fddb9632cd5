"""An environment map, made ready to light many scenes.

Everything that depends on the map alone is computed once: its energy at falling resolutions, its
irradiance, where its strong light is. A scene rotates its own normals into the map's frame.
"""

import math
from dataclasses import dataclass

import numpy as np

from lime_keras.optics import environment, shading

from . import environments
from .quality import FAST, Quality

MEAN_RADIANCE = 0.4
"""Spherical mean to which every map is scaled: the exposure (docs/decisions.md)."""
_COARSEST = 16
_FEWEST_ROWS = 32
_IRRADIANCE_LIGHTS = 64  # rows of the map that lights the irradiance table, at least


@dataclass(frozen=True)
class Level:
    """A map's energy gathered into `(H, W)` texels.

    Attributes:
        energy: radiance times solid angle of each texel, `(H, W)`.
        direction: unit energy-weighted mean direction of what each texel holds, `(H, W, 3)`: the
            first moment is kept, so a lamp stays where it is at every resolution.
    """

    energy: np.ndarray
    direction: np.ndarray


@dataclass(frozen=True)
class Light:
    """One map in its own frame, scaled to a spherical mean.

    Attributes:
        name: file or room it came from.
        radiance: `(H, W)`, the finest resolution.
        levels: energies by height, from the quality's finest, or the power of two below the map's
            own, down to 16.
        diffuse_shading: `(R, 2 R)`, D for a normal in the direction of each texel.
        strong_direction: `(3,)` unit, towards the texel of most energy.
        quality: how finely it lights.
    """

    name: str
    radiance: np.ndarray
    levels: dict[int, Level]
    diffuse_shading: np.ndarray
    strong_direction: np.ndarray
    quality: Quality

    def coarse(self) -> np.ndarray:
        """The map at twice the rows that a record keeps, or its own if it has fewer: `(H, W)`."""
        height = min(2 * environment.STORED_SHAPE[0], max(self.levels))
        energy = self.levels[height].energy
        return energy / environment.solid_angles(*energy.shape)

    def cut(self, exponent: float) -> tuple[np.ndarray, np.ndarray]:
        """The map as lights for a lobe of this exponent: directions `(T, 3)`, energies `(T,)`.

        A cut through the pyramid: bright or wide texels are split until the error that their
        extent makes in the lobe is small, dim ones are taken whole.
        """
        directions, energies = [], []
        height = min(self.levels)
        total = float(np.sum(self.levels[height].energy))
        # Share of the sphere's energy that a lobe of this exponent sees from an even light.
        seen = min(1.0, 4.0 / (exponent + 2.0))
        open_texels = np.ones(self.levels[height].energy.shape, bool)
        while height in self.levels:
            level = self.levels[height]
            extent = math.pi / height
            if 2 * height in self.levels:
                error = level.energy / (total * seen) * (extent**2 * (exponent + 2.0))
                split = open_texels & (error > self.quality.split_above)
            else:
                split = np.zeros_like(open_texels)
            whole = open_texels & ~split & (level.energy > 0)
            directions.append(level.direction[whole])
            energies.append(level.energy[whole])
            open_texels = np.repeat(np.repeat(split, 2, axis=0), 2, axis=1)
            height *= 2
        return np.concatenate(directions), np.concatenate(energies)


def prepare(
    name: str, radiance: np.ndarray, mean: float = MEAN_RADIANCE, quality: Quality = FAST
) -> Light:
    """Scale a map `(H, W)` to the spherical mean and precompute what scenes need.

    Args:
        name: to be told with the light, and in errors.
        radiance: `(H, W)`, W about 2 H, of any size.
        mean: the spherical mean of the result.
        quality: how finely it is to light.

    Raises:
        ValueError: if the map is black or not finite.
    """
    # Repeating the texels of a small map changes its radiance nowhere.
    repeats = -(-_FEWEST_ROWS // min(len(radiance), radiance.shape[1] // 2))
    radiance = radiance.repeat(repeats, axis=0).repeat(repeats, axis=1)
    rows, columns = radiance.shape
    average = environment.spherical_mean(radiance)
    if not np.isfinite(average) or average <= 0:
        raise ValueError(f"{name}: the map's mean radiance is {average}; a light must shine")
    scaled = radiance.astype(np.float64) * (mean / average)
    finest = _COARSEST
    while 2 * finest <= min(rows, columns // 2, quality.finest):
        finest *= 2
    levels = _levels(environments.resized(scaled, finest), quality.precision)
    rows = quality.irradiance_rows
    normals = environment.directions(rows, 2 * rows).reshape(-1, 3).astype(quality.precision)
    middle = levels[min(max(rows, _IRRADIANCE_LIGHTS), finest)]
    flat = shading.diffuse(normals, middle.direction.reshape(-1, 3), middle.energy.reshape(-1))
    brightest = np.argmax(levels[_COARSEST].energy)
    return Light(
        name=name,
        radiance=scaled.astype(quality.precision),
        levels=levels,
        diffuse_shading=flat.reshape(rows, 2 * rows),
        strong_direction=levels[_COARSEST].direction.reshape(-1, 3)[brightest],
        quality=quality,
    )


def _levels(radiance: np.ndarray, precision: str) -> dict[int, Level]:
    """Gather a map's energy and its first moment into ever larger texels."""
    energy = radiance * environment.solid_angles(*radiance.shape)
    moment = energy[..., None] * environment.directions(*radiance.shape)
    levels = {}
    while len(energy) >= _COARSEST:
        length = np.linalg.norm(moment, axis=-1, keepdims=True)
        centres = environment.directions(*energy.shape)
        direction = np.where(length > 0, moment / np.maximum(length, 1e-300), centres)
        levels[len(energy)] = Level(energy.astype(precision), direction.astype(precision))
        energy, moment = _halve(energy), _halve(moment)
    return levels


def _halve(values: np.ndarray) -> np.ndarray:
    """Sums over 2 × 2 texels of `(H, W)` or `(H, W, C)`."""
    return values[0::2, 0::2] + values[1::2, 0::2] + values[0::2, 1::2] + values[1::2, 1::2]
