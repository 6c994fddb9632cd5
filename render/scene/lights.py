"""Environment maps, prepared to light many scenes.

Everything that depends on the map alone is computed once: its energy at several resolutions, its
irradiance, the direction of its strongest light. A scene rotates its normals into the map's frame.
"""

import functools
import itertools
import math
from dataclasses import dataclass

import numpy as np

from lime_keras.optics import environment
from lime_keras.optics.environment import MEAN_RADIANCE

from . import environments
from .quality import FAST, Quality

_COARSEST = 16
_FEWEST_ROWS = 32
_DIAGONAL = 1.5  # largest distance of two directions in a texel, in heights of the texel


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

    @functools.cached_property
    def total(self) -> float:
        """The sum of the energies."""
        return float(np.sum(self.energy))


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
        return energy / environment.solid_angles(*energy.shape).astype(energy.dtype)

    @functools.cached_property
    def filtered(self) -> tuple[np.ndarray, ...]:
        """The radiance at its own resolution, and averaged to ever fewer rows, powers of two."""
        rows, finest = len(self.radiance), max(self.levels)
        out = [self.radiance]
        height = 2 ** math.ceil(math.log2(rows))
        while (height := height // 2) > finest:
            if 2 * height <= self.radiance.shape[1]:
                out.append(environments.resized(self.radiance, height).astype(self.radiance.dtype))
        for height in sorted(self.levels, reverse=True):
            if height < rows:
                energy = self.levels[height].energy
                solid_angle = environment.solid_angles(*energy.shape)
                out.append((energy / solid_angle).astype(self.radiance.dtype))
        return tuple(out)

    @functools.cached_property
    def _texels(self) -> np.ndarray:
        """Direction and energy of the texels of all levels, `(4, N)`, the coarsest level first."""
        levels = [self.levels[height] for height in sorted(self.levels)]
        directions = np.concatenate([level.direction.reshape(-1, 3) for level in levels])
        energies = np.concatenate([level.energy.ravel() for level in levels])
        return np.ascontiguousarray(np.column_stack([directions, energies]).T)

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
        height, first = min(self.levels), 0
        x, y, z, energies = self._texels
        group, texel = self._candidates(support, axes, radii)
        groups, places = [], []
        while True:
            # Take whole what is not split.
            place = texel + first
            cosine = x.take(place) * axes[:, 0].take(group)
            cosine += y.take(place) * axes[:, 1].take(group)
            cosine += z.take(place) * axes[:, 2].take(group)
            energy = energies.take(place)
            away = np.arccos(np.clip(cosine, -1, 1)) - radii.take(group)
            nearest = np.clip(away - _DIAGONAL * math.pi / height, 0, math.pi)
            split = (nearest <= support) & self._coarse(energy, nearest, exponent, height)
            whole = np.flatnonzero(~split & (energy > 0) & (away <= support))
            groups.append(group.take(whole))
            places.append(place.take(whole))
            if not split.any():
                break
            # Go on with the four texels of each other.
            parts = np.flatnonzero(split)
            row, column = np.divmod(texel.take(parts), 2 * height)
            first += 2 * height**2
            height, group = 2 * height, np.repeat(group.take(parts), 4)
            corner = 2 * (2 * height * row + column)
            texel = (corner[:, None] + [0, 1, 2 * height, 2 * height + 1]).ravel()
        # Sort by group.
        group = np.concatenate(groups)
        order = np.argsort(group, kind="stable")
        lights = self._texels.take(np.concatenate(places).take(order), axis=1)
        ends = np.cumsum(np.bincount(group, minlength=len(axes))).tolist()
        spans = [slice(*pair) for pair in itertools.pairwise([0, *ends])]
        return [(lights[:3, span].T, lights[3, span]) for span in spans]

    def _candidates(
        self, support: float, axes: np.ndarray, radii: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the groups and the texels of the coarsest level that `cut` begins with.

        Texels that surely lie beyond all lobes of a group are left out.
        """
        height = min(self.levels)
        reach = support + radii + _DIAGONAL * math.pi / height
        # Rounding moves a cosine by less than this.
        least = np.cos(np.minimum(reach, math.pi)) - 1e-5
        group, texel = np.nonzero(
            axes @ self.levels[height].direction.reshape(-1, 3).T > least[:, None]
        )
        return group.astype(np.uint16), texel

    def _coarse(
        self, energy: np.ndarray, away: np.ndarray, exponent: float, height: int
    ) -> np.ndarray:
        """Return whether texels of a level, `away` radians from a lobe, are to be split for it."""
        if 2 * height not in self.levels:
            return np.zeros(len(energy), bool)
        # Share of a uniform light's energy that a lobe of this exponent sees.
        share = min(1.0, 4.0 / (exponent + 2.0))
        total = self.levels[height].total
        fall = exponent * np.log(np.maximum(np.cos(away / 2), 1e-30))
        # How much the lobe is curved there, relative to its middle.
        curved = np.exp(fall) * (1 - 2 * fall)
        error = energy / (total * share) * curved * ((math.pi / height) ** 2 * (exponent + 2.0))
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
        ValueError: if the map is black, negative somewhere, or not finite.
    """
    try:
        environment.check(radiance)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error
    # A small map is enlarged by repeating its texels, which leaves its radiance as it is.
    repeats = -(-_FEWEST_ROWS // min(len(radiance), radiance.shape[1] // 2))
    if repeats > 1:
        radiance = radiance.repeat(repeats, axis=0).repeat(repeats, axis=1)
    rows, columns = radiance.shape
    average = environment.spherical_mean(radiance)
    if not np.isfinite(average) or average <= 0:
        raise ValueError(f"{name}: the map's mean radiance is {average}; a light must shine")
    gain = np.float64(mean / average)
    finest = _COARSEST
    while 2 * finest <= min(rows, columns // 2, quality.finest):
        finest *= 2
    texels = (environments.resized(radiance, finest) * gain).astype(np.float32)
    levels = _levels(texels, quality.precision)
    brightest = np.argmax(levels[_COARSEST].energy)
    return Light(
        name=name,
        radiance=(radiance * gain).astype(quality.precision),
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
    moment = energy * _directions(len(energy))
    levels = {}
    while len(energy) >= _COARSEST:
        length = np.sqrt(moment[0] ** 2 + moment[1] ** 2 + moment[2] ** 2)
        direction = (moment / np.maximum(length, 1e-300)).astype(precision)
        if not length.all():
            direction = np.where(length > 0, direction, _directions(len(energy)).astype(precision))
        levels[len(energy)] = Level(
            energy.astype(precision), np.ascontiguousarray(np.moveaxis(direction, 0, -1))
        )
        energy, moment = _halve(energy), _halve(moment)
    return levels


@functools.lru_cache(8)
def _directions(height: int) -> np.ndarray:
    """Return the directions through the texels of a map of that many rows, `(3, H, W)`."""
    towards = np.moveaxis(environment.directions(height, 2 * height), -1, 0)
    out = np.ascontiguousarray(towards)
    out.flags.writeable = False  # many lights share it
    return out


def _halve(values: np.ndarray) -> np.ndarray:
    """Return the sums over 2 × 2 texels of `(..., H, W)` values."""
    rows = values[..., 0::2, :], values[..., 1::2, :]
    left, right = ([row[..., side::2] for row in rows] for side in (0, 1))
    return left[0] + left[1] + right[0] + right[1]


def _diffuse_shading(energy: np.ndarray, rows: int) -> np.ndarray:
    """Return the table of D, `(rows, 2 rows)`, under the texels of the finest level.

    max(n·i, 0) is half of n·i + |n·i|. The sum of n·i is that of the light's first moment. |n·i| is
    the same in opposite directions, so half of the sphere suffices. It depends on the difference of
    the two azimuths alone, so the sum along a row of texels is a correlation: a product of spectra.
    """
    height, width = energy.shape
    precision, energy = energy.dtype, energy.astype(float)  # shadows are differences of large sums
    moment = _directions(height).reshape(3, -1) @ energy.ravel()
    folded = energy[: height // 2] + np.roll(energy[: height // 2 - 1 : -1], height, axis=1)
    spectrum = (np.fft.rfft(folded) * _phase(rows, height)).T
    pairs = np.stack([spectrum.real, spectrum.imag], axis=-1)
    product = (_cosine_spectrum(rows, height) @ pairs).view(np.complex128)[..., 0]
    upper = np.fft.irfft(product.T, width)[:, :: height // rows]
    even = np.concatenate([upper, np.roll(upper[::-1], rows, axis=1)])
    odd = np.tensordot(moment, _directions(rows), 1)
    return (np.maximum(even + odd, 0) / (2 * math.pi)).astype(precision)


@functools.lru_cache(1)
def _cosine_spectrum(rows: int, height: int) -> np.ndarray:
    """Return the spectra of |n·i| along azimuth, `(height + 1, rows / 2, height / 2)`.

    They are divided by `_phase`, and then real, because |n·i| is the same to both sides of n. n are
    the texels of the upper half of a first column of `rows` texels, i those of the upper half of a
    map of `height` rows.
    """
    normal = environment.directions(rows, 2 * rows)[: rows // 2, 0]
    light = environment.directions(height, 2 * height)[: height // 2]
    out = np.empty((height + 1, rows // 2, height // 2))
    for row, direction in enumerate(normal):  # all rows at once would take three times the memory
        spectrum = np.fft.rfft(np.abs(light @ direction)).conj() / _phase(rows, height)
        out[:, row] = spectrum.real.T
    return out


def _phase(rows: int, height: int) -> np.ndarray:
    """Return the phases `(height + 1,)` by which the azimuth of a first column shifts spectra.

    A first column of `rows` texels lies between two columns of a map of `height` rows, or on one.
    """
    shift = (height / rows - 1) / 2  # in texels of the map
    return np.exp(1j * math.pi * shift / height * np.arange(height + 1))
