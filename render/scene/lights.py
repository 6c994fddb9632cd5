"""Environment maps, prepared to light many scenes.

Everything that depends on the map alone is computed once: its energy at several resolutions, its
irradiance, the direction of its strongest light. A scene rotates its normals into the map's frame.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from lime_keras.optics import environment
from lime_keras.optics.environment import MEAN_RADIANCE

from . import environments
from .quality import FAST, Quality

_COARSEST = 16
_FEWEST_ROWS = 32
_DIAGONAL = 1.5
"""Largest distance of two directions in a texel, in heights of the texel."""


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
        diffuse_shading: table of D, `(R, 2 R)`, for a normal in the direction of each texel. R is
            the quality's number of rows, or that of the finest level if it is smaller.
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

    def cut(
        self, exponent: float, support: float, axes: np.ndarray, radii: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return directions `(T, 3)` and energies `(T,)` of lights for each of G groups of lobes.

        The lights are a cut through the pyramid of levels: bright or wide texels in the middle of a
        lobe are split until their extent causes little error in it; dim texels and those at the
        lobes' ends are taken whole, and those beyond all lobes left out.

        Args:
            exponent: s of all lobes.
            support: angle in radians from the middle of a lobe beyond which it is negligible.
            axes: unit direction of each group, `(G, 3)`.
            radii: largest angle in radians between the middle of a lobe and its group's axis,
                `(G,)`.
        """
        height = min(self.levels)
        group, texel = np.indices((len(axes), 2 * height**2)).reshape(2, -1)
        found = []
        while True:
            # Take whole what is not split.
            level = self.levels[height]
            direction = level.direction.reshape(-1, 3)[texel]
            energy = level.energy.reshape(-1)[texel]
            cosine = np.einsum("ij,ij->i", direction, axes[group])
            away = np.arccos(np.clip(cosine, -1, 1)) - radii[group]
            nearest = np.clip(away - _DIAGONAL * math.pi / height, 0, math.pi)
            split = (nearest <= support) & self._coarse(energy, nearest, exponent, height)
            whole = np.flatnonzero(~split & (energy > 0) & (away <= support))
            found.append((group[whole], direction[whole], energy[whole]))
            if not split.any():
                break
            # Go on with the four texels of each other.
            row, column = np.divmod(texel[split], 2 * height)
            height, group = 2 * height, np.repeat(group[split], 4)
            corner = 2 * (2 * height * row + column)
            texel = (corner[:, None] + [0, 1, 2 * height, 2 * height + 1]).ravel()
        # Sort by group.
        groups, directions, energies = map(np.concatenate, zip(*found, strict=True))
        order = np.argsort(groups, kind="stable")
        ends = np.cumsum(np.bincount(groups, minlength=len(axes)))[:-1]
        parts = np.split(directions[order], ends), np.split(energies[order], ends)
        return list(zip(*parts, strict=True))

    def _coarse(
        self, energy: np.ndarray, away: np.ndarray, exponent: float, height: int
    ) -> np.ndarray:
        """Return whether texels of a level, `away` radians from a lobe, are to be split for it."""
        if 2 * height not in self.levels:
            return np.zeros(len(energy), bool)
        # Share of a uniform light's energy that a lobe of this exponent sees.
        seen = min(1.0, 4.0 / (exponent + 2.0))
        total = float(np.sum(self.levels[height].energy))
        fall = exponent * np.log(np.maximum(np.cos(away / 2), 1e-30))
        # How much the lobe is curved there, relative to its middle.
        curved = np.exp(fall) * (1 - 2 * fall)
        error = energy / (total * seen) * curved * ((math.pi / height) ** 2 * (exponent + 2.0))
        return error > self.quality.split_above


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
    brightest = np.argmax(levels[_COARSEST].energy)
    return Light(
        name=name,
        radiance=scaled.astype(quality.precision),
        levels=levels,
        diffuse_shading=_diffuse_shading(
            levels[finest].energy, min(quality.irradiance_rows, finest)
        ),
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


def _diffuse_shading(energy: np.ndarray, rows: int) -> np.ndarray:
    """Return the table of D, `(rows, 2 rows)`, under the texels of the finest level.

    max(n·i, 0) is half of n·i + |n·i|. The sum of n·i is that of the light's first moment. |n·i| is
    the same in opposite directions, so half of the sphere suffices. It depends on the difference of
    the two azimuths alone, so the sum along a row of texels is a correlation: a product of spectra.
    """
    height, width = energy.shape
    precision, energy = energy.dtype, energy.astype(float)  # shadows are differences of large sums
    moment = np.tensordot(energy, environment.directions(height, width), 2)
    folded = energy[: height // 2] + np.roll(energy[: height // 2 - 1 : -1], height, axis=1)
    spectrum = _cosine_spectrum(rows, height) @ np.fft.rfft(folded).T[..., None]
    upper = np.fft.irfft(spectrum[..., 0].T, width)[:, :: height // rows]
    even = np.concatenate([upper, np.roll(upper[::-1], rows, axis=1)])
    odd = environment.directions(rows, 2 * rows) @ moment
    return (np.maximum(even + odd, 0) / (2 * math.pi)).astype(precision)


@functools.lru_cache(1)
def _cosine_spectrum(rows: int, height: int) -> np.ndarray:
    """Return the spectra of |n·i| along azimuth, `(height + 1, rows / 2, height / 2)`, conjugated.

    n are the texels of the upper half of a first column of `rows` texels, i those of the upper half
    of a map of `height` rows.
    """
    normal = environment.directions(rows, 2 * rows)[: rows // 2, 0]
    light = environment.directions(height, 2 * height)[: height // 2]
    out = np.empty((height + 1, rows // 2, height // 2), np.complex128)
    for row, direction in enumerate(normal):  # all rows at once would take three times the memory
        out[:, row] = np.fft.rfft(np.abs(light @ direction)).conj().T
    return out
