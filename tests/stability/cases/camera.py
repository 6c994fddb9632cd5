"""Cases for photos of scenes on the fly: the camera, JPEG, composition and reduction."""

import functools
import itertools
from typing import Any

import mpmath
import numpy as np
import tensorflow as tf

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import camera_law
from lime_keras.synthesis import backdrop, jpeg, photograph, reduction

from .. import curves, srgb_standard
from ..precisions import ARRAYS, ROUNDINGS, SINGLE, XLA, Precision

_SIDE = 16
_SATURATED = float(camera_law.SATURATED)
_RADIANCES = {
    "0": 0.0,
    "1e-38": 1e-38,
    "1e-7": 1e-7,
    "1e-3": 1e-3,
    "0.0031308": 0.0031308,
    "0.18": 0.18,
    "0.5": 0.5,
    "next to saturation": _SATURATED * (1 - 1e-5),
    "saturation": _SATURATED,
    "1": 1.0,
    "65504": 65504.0,
    "1e30": 1e30,
}
_FULL_WELLS = {"1,000 electrons": 1e3, "30,000 electrons": 3e4}
_LEVELS, _QUALITIES = (0, 1, 127, 128, 254, 255), (1, 25, 50, 75, 98, 100)
_GREYS = list(itertools.product(_LEVELS, _QUALITIES))
_LIT, _COVERAGES = (0.0, 1e-30, 1.0, 65504.0, 1e30), (0.0, 1 / 255, 0.5, 1.0)
_COMPOSED = list(itertools.product(_LIT, _COVERAGES))
_LAW = {
    "exposure": (camera_law.exposure, lambda x: 2 ** (mpmath.mpf("0.5") * (2 * x - 1))),
    "full well": (camera_law.full_well, lambda x: 1000 * mpmath.mpf(30) ** x),
    "JPEG quality": (camera_law.quality, lambda x: 60 + 38 * x),
}
_NUMBERS = {"0": 0.0, "1e-30": 1e-30, "1/4": 0.25, "1/2": 0.5, "1 - 2^-24": 1 - 2.0**-24, "1": 1.0}


def cases() -> list[Case]:
    """Return the cases of photos."""
    out = []

    def add(part: str, name: str, precision: Precision, measure: Any, *arguments: Any) -> None:
        measure = functools.partial(measure, precision, *arguments)
        out.append(Case(part, name, precision.name, measure))

    for precision in (SINGLE, XLA):
        for row, name in enumerate(_RADIANCES):
            add("photo taken", f"radiance {name}, clipped", precision, _clipped, row)
            for well in _FULL_WELLS:
                add("photo taken", f"radiance {name}, {well}", precision, _noisy, row, well)
        for row, (level, quality) in enumerate(_GREYS):
            add("JPEG", f"grey of level {level}, quality {quality}", precision, _packed, row)
        for row, (radiance, coverage) in enumerate(_COMPOSED):
            name = f"radiance {radiance:g}, coverage {coverage:.3g}"
            add("composition", name, precision, _before, row)
        for row, (mask, radiance) in enumerate(itertools.product(_masks(), _LIT)):
            name = f"{mask} mask, radiance {radiance:g}"
            add("reduction", name, precision, _reduced, mask, radiance, row)
    for name, (function, exact) in _LAW.items():
        part, precisions = f"camera law: {name}", (SINGLE, XLA, *ARRAYS)
        out += curves.cases(part, function, exact, _NUMBERS, precisions)
    return out


def _run(precision: Precision, function: Any, *arrays: np.ndarray) -> Any:
    """Return a function of tensors, as numbers in double precision by name."""
    run = tf.function(function, jit_compile=True) if precision.compiled else function
    found = run(*(tf.constant(np.asarray(array)) for array in arrays))
    return {name: np.asarray(np.asarray(value), np.float64) for name, value in found.items()}


def _images(values: Any) -> np.ndarray:
    """Return an even image `(B, 16, 16, 3)` float32 of each of B values."""
    return (
        np.ones((1, _SIDE, _SIDE, 3), np.float32)
        * np.asarray(values, np.float32)[:, None, None, None]
    )


# Photos.


@functools.cache
def _plain(precision: Precision) -> dict[str, np.ndarray]:
    radiance = _images(list(_RADIANCES.values()))
    return _run(precision, lambda light: photograph.photograph(light, {}), radiance)


def _clipped(precision: Precision, row: int) -> Outcome:
    """Try a photo without noise: the level of the radiance, and whether it saturates."""
    photo = _plain(precision)
    light = float(np.float32(list(_RADIANCES.values())[row]))
    return _photo(photo, row, light, ROUNDINGS * precision.epsilon * light)


@functools.cache
def _sensed(precision: Precision, well: str) -> dict[str, np.ndarray]:
    count = len(_RADIANCES)
    one = np.ones(count, np.float32)
    draws = {
        "exposure": one,
        "defocus": one,
        "full_well": np.asarray(_FULL_WELLS[well], np.float32) * one,
        "quality": 90 * one,
        "compressed": 0 * one,
        "cast": np.zeros((count, 4), np.float32),
        "grain": np.tile(_grain(), (count, 1)),
    }

    def take(light: Any, *values: Any) -> Any:
        return photograph.photograph(light, {}, dict(zip(draws, values, strict=True)))

    return _run(precision, take, _images(list(_RADIANCES.values())), *draws.values())


def _grain() -> np.ndarray:
    """Return rows of the noise table, of which the first holds its largest number."""
    table = camera_law.grain_table()
    extreme = int(np.abs(table).max(axis=1).argmax())
    return np.arange(extreme, extreme + 3 * _SIDE**2 // table.shape[1], dtype=np.int32) % len(table)


def _noisy(precision: Precision, row: int, well: str) -> Outcome:
    """Try a photo with noise: (√(L + d) + σ ν)² − d − σ² with d and σ of the sensor."""
    photo, electrons = _sensed(precision, well), _FULL_WELLS[well]
    light = float(np.float32(list(_RADIANCES.values())[row]))
    dark, deviation = camera_law.READ_NOISE**2 / electrons, 0.5 / np.sqrt(electrons)
    noise = np.asarray(camera_law.grain_table()[_grain()], np.float64).reshape(_SIDE, _SIDE, 3)
    root = np.sqrt(light + dark) + deviation * noise
    size = light + dark + np.square(root)
    error = (ROUNDINGS + np.sqrt(9)) * precision.epsilon * size
    return _photo(photo, row, np.square(root) - dark - deviation**2, error, light)


def _photo(
    photo: dict[str, np.ndarray], row: int, linear: Any, error: Any, light: float | None = None
) -> Outcome:
    """Compare a photo's levels, which an error of the radiance may move to the next one."""
    low, high = (np.clip(np.asarray(linear) + side * error, 0, 1) for side in (-1, 1))
    slack = 255 * ROUNDINGS * 2.0**-23
    low, high = (
        np.floor(255 * srgb_standard.encoded(end) + 0.5 + side * slack) / 255
        for end, side in ((low, -1), (high, 1))
    )
    saturates = float(np.max(linear) >= _SATURATED if light is None else light >= _SATURATED)
    image, clipped = photo["image"][row], photo["clipped"][row]
    doubtful = light is not None and abs(light / _SATURATED - 1) < 2e-5
    found = np.stack([image, clipped])
    low, high = (
        np.stack([np.broadcast_to(end, image.shape), np.full(image.shape, flag)])
        for end, flag in (
            (low, 0.0 if doubtful else saturates),
            (high, 1.0 if doubtful else saturates),
        )
    )
    return Outcome(SINGLE.compare(found, low, high, high))


# JPEG.


@functools.cache
def _pack(precision: Precision) -> np.ndarray:
    levels, qualities = (np.asarray(column, np.float32) for column in zip(*_GREYS, strict=True))
    return _run(
        precision,
        lambda image, quality: {"image": jpeg.compressed(image, quality)},
        _images(levels),
        qualities,
    )["image"]


def _packed(precision: Precision, row: int) -> Outcome:
    """Try an even grey: it stays even, and within half a step of the mean's coefficient.

    That coefficient is 8 times the level, and its step 16 times the quality's scale; the level
    itself is rounded, too. What lies outside 0…255 is clipped.
    """
    level, quality = _GREYS[row]
    per_cent = 5000 // quality if quality < 50 else 200 - 2 * quality
    step = min(max((16 * per_cent + 50) // 100, 1), 255)
    found = _pack(precision)[row]
    reach = step / 16 + 0.5
    low, high = max(level - reach, 0), min(level + reach, 255)
    found = np.append(found.ravel(), [np.ptp(found), np.abs(found - np.round(found)).max()])
    even = np.ones(found.size - 2)
    return Outcome(
        Compared(found, np.append(low * even, [0.0, 0.0]), np.append(high * even, [0.0, 0.0]), 0.0)
    )


# Composition and reduction.


@functools.cache
def _compose(precision: Precision) -> np.ndarray:
    radiance, coverage = (np.asarray(column, np.float32) for column in zip(*_COMPOSED, strict=True))
    return _run(
        precision,
        lambda own, share, behind: {"image": backdrop.compose(own, share, behind)},
        _images(radiance),
        _images(coverage)[..., :1],
        _images(np.full(len(radiance), 0.25)),
    )["image"]


def _before(precision: Precision, row: int) -> Outcome:
    """Try an object before a background of 0.25."""
    radiance, coverage = (float(np.float32(value)) for value in _COMPOSED[row])
    right = coverage * radiance + (1 - coverage) * 0.25
    return Outcome(precision.compare(_compose(precision)[row], right, right, right + 0.25))


@functools.cache
def _masks() -> dict[str, np.ndarray]:
    """Return masks `(16, 16, 1)` of coverage by name."""
    full = np.ones((_SIDE, _SIDE, 1), np.float32)
    one = np.zeros_like(full)
    one[5, 6] = 1.0
    return {"empty": 0 * full, "one-pixel": one, "faint one-pixel": one / 255, "full": full}


@functools.cache
def _reduce(precision: Precision) -> dict[str, np.ndarray]:
    drawn = list(itertools.product(_masks().values(), _LIT))
    masks = np.stack([mask for mask, _ in drawn])
    layers = _images([radiance for _, radiance in drawn])[..., :1]

    def reduce(mask: Any, layer: Any) -> Any:
        return reduction.reduced({"mask": mask, "specular_shading": layer}, _SIDE // 4)

    return _run(precision, reduce, masks, layers)


def _reduced(precision: Precision, mask: str, radiance: float, row: int) -> Outcome:
    """Try layers averaged over covered pixels: an even layer keeps its value; none is NaN."""
    means = np.asarray(_masks()[mask], np.float64).reshape(4, 4, 4, 4, 1).mean((1, 3))
    layer = np.where(means > 0, float(np.float32(radiance)), 0.0)
    right = np.stack([means, layer])
    reduced = _reduce(precision)
    found = np.stack([reduced["mask"][row], reduced["specular_shading"][row]])
    return Outcome(precision.compare(found, right, right, right, terms=16))
