"""Environment maps, prepared to light many scenes.

Everything that depends on the map alone is computed once: its energy at several resolutions, its
irradiance, the direction of its strongest light. A scene rotates its normals into the map's frame.
"""

import math
from dataclasses import dataclass

import numpy as np

from lime_keras.optics import environment, shading
from lime_keras.optics.environment import MEAN_RADIANCE

from . import environments
from .quality import FAST, Quality

_COARSEST = 16
_FEWEST_ROWS = 32
_IRRADIANCE_LIGHTS = 64  # least rows of the level from which the irradiance table is computed


@dataclass(frozen=True)
class Level:
    """The energy of a map at one resolution, in `(H, W)` texels.

    Attributes:
        energy: radiance times solid angle of each texel, `(H, W)`.
        direction: energy-weighted mean direction of the light in each texel, unit, `(H, W, 3)`.
            The first moment is kept, so a lamp stays where it is at every resolution.
    """

    energy: np.ndarray
    direction: np.ndarray


@dataclass(frozen=True)
class Light:
    """An environment map in its own frame, scaled to a spherical mean.

    Attributes:
        name: name of the file or room that the map came from.
        radiance: radiance at the finest resolution, `(H, W)`.
        levels: energies by number of rows: powers of two from 16 up to the quality's finest, as far
            as the map's own rows reach.
        diffuse_shading: table of D, `(R, 2 R)`, for a normal in the direction of each texel.
        strong_direction: unit direction `(3,)` of the texel of most energy.
        quality: resolution and precision of the light.
    """

    name: str
    radiance: np.ndarray
    levels: dict[int, Level]
    diffuse_shading: np.ndarray
    strong_direction: np.ndarray
    quality: Quality

    def coarse(self) -> np.ndarray:
        """Return the radiance `(H, W)` at twice the rows of a record's map, or at the finest level.

        The finest level is taken if it has fewer rows.
        """
        height = min(2 * environment.STORED_SHAPE[0], max(self.levels))
        energy = self.levels[height].energy
        return energy / environment.solid_angles(*energy.shape)

    def cut(self, exponent: float) -> tuple[np.ndarray, np.ndarray]:
        """Return directions `(T, 3)` and energies `(T,)` of lights for a lobe of this exponent.

        The lights are a cut through the pyramid of levels: bright or wide texels are split until
        their extent causes little error in the lobe; dim texels are taken whole.
        """
        directions, energies = [], []
        height = min(self.levels)
        total = float(np.sum(self.levels[height].energy))
        # Share of a uniform light's energy that a lobe of this exponent sees.
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
    """Scale a map to the spherical mean and compute everything that depends on the map alone.

    Args:
        name: name of the light, also used in errors.
        radiance: the map, `(H, W)`, W about 2 H, of any size.
        mean: spherical mean of the scaled map.
        quality: resolution and precision of the light.

    Raises:
        ValueError: if the map is black or not finite.
    """
    # A small map is enlarged by repeating its texels, which leaves its radiance as it is.
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
    """Return the levels of a map by height; each height is half of the height before."""
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
    """Return the sums over 2 × 2 texels of `(H, W)` or `(H, W, C)` values."""
    return values[0::2, 0::2] + values[1::2, 0::2] + values[0::2, 1::2] + values[1::2, 1::2]
