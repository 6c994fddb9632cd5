"""Cases for environment maps and M: poles and seam, bright and dim lights, bad texels."""

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import environment, shading

from ..lights import HEIGHT, lights, surface, unit
from ..precisions import ARRAYS, NUMPY_SINGLE, ROUNDINGS, Precision
from ..refusals import refusal

_UNSOUND = {"NaN": np.nan, "infinite": np.inf, "negative": -1.0}
# Unit vectors through the zenith, the nadir, and the seam behind the camera, from both sides.
_POLES_AND_SEAM = {
    "the pole above": [(0.0, 1.0, 0.0), (-0.0, 1.0, -0.0), (1e-30, 1.0, 0.0)],
    "the pole below": [(0.0, -1.0, 0.0), (-0.0, -1.0, -0.0), (0.0, -1.0, -1e-30)],
    "near the poles": [(1e-3, 1.0, 0.0), (0.0, -1.0, 1e-3)],
    "the seam": [(0.0, 0.0, -1.0), (-0.0, 0.0, -1.0), (1e-30, 0.0, -1.0), (-1e-30, 0.6, -0.8)],
    "near the seam": [(1e-4, 0.0, -1.0), (-1e-4, 0.0, -1.0), (-1e-7, 0.6, -0.8)],
    "the front": [(0.0, 0.0, 1.0), (-0.0, 0.0, 1.0), (1e-7, 0.0, 1.0)],
}


def cases() -> list[Case]:
    """Return the cases of M and of functions of environment maps."""
    out = []
    for precision in ARRAYS:
        for light in lights():
            measure = functools.partial(_mirror, light, precision)
            out.append(Case("M", light, precision.name, measure))
        for place, directions in _POLES_AND_SEAM.items():
            measure = functools.partial(_mirror_at, directions, precision)
            out.append(Case("M", f"{place} of the map", precision.name, measure))
        for radiance in (0.0, 1e-8, 1.0, 1e8):
            for name, function in (("mean of", _mean), ("rotation of", _rotated)):
                measure = functools.partial(function, radiance, precision)
                out.append(Case("map", f"{name} radiance {radiance:g}", precision.name, measure))
    return out + _refusals()


def _refusals() -> list[Case]:
    takers: dict[str, Callable[[np.ndarray], Any]] = {
        "texels": lambda radiance: shading.texels(radiance),
        "rotate": lambda radiance: environment.rotate(radiance, np.eye(3), 8, 16),
    }
    return [
        Case(
            "map",
            f"{name} texel refused by {taker}",
            NUMPY_SINGLE.name,
            functools.partial(_refused, take, value),
        )
        for taker, take in takers.items()
        for name, value in _UNSOUND.items()
    ]


def _refused(take: Callable[[np.ndarray], Any], value: float) -> Outcome:
    radiance = np.ones((HEIGHT, 2 * HEIGHT), np.float32)
    radiance[5, 7] = value
    return refusal(lambda: take(radiance), str(np.float32(value)), "row 5, column 7", "repair")


def _mirror(light: str, precision: Precision) -> Outcome:
    normal, view = surface()
    found, _ = precision.evaluate(
        lambda n, o, radiance: environment.lookup(radiance, shading.reflect(n, o)),
        normal,
        view,
        lights()[light],
    )
    n, o = precision.rounded(normal), precision.rounded(view)
    mirrored = 2 * np.sum(n * o, axis=-1, keepdims=True) * n - o
    return Outcome(_looked_up(found, mirrored, lights()[light], precision))


def _mirror_at(directions: list[tuple[float, float, float]], precision: Precision) -> Outcome:
    """Try M where the view direction is the normal, so that M is the light in that direction."""
    radiance = lights()["radiance 1e-8"]
    facing = unit(np.array(directions))
    found, _ = precision.evaluate(
        lambda n, radiance: environment.lookup(radiance, shading.reflect(n, n)), facing, radiance
    )
    return Outcome(_looked_up(found, precision.rounded(facing), radiance, precision))


def _looked_up(
    found: np.ndarray, direction: np.ndarray, radiance: np.ndarray, precision: Precision
) -> Compared:
    """Compare radiance found in directions with slow look-ups in the map."""
    radiance = precision.rounded(radiance)
    rows = [_slow_look_up(d, radiance, precision.epsilon) for d in direction]
    low, high, size = np.array(rows).T
    return Compared(found, low, high, precision.tolerance(size))


def _slow_look_up(
    direction: np.ndarray, radiance: np.ndarray, epsilon: float
) -> tuple[float, float, float]:
    """Return the least and greatest correct bilinear interpolation, and its error's magnitude.

    The interpolation goes texel by texel and takes the angles from their definition. A direction
    that rounding cannot distinguish from a pole may have any longitude.
    """
    height, width = radiance.shape
    x, y, z = direction / np.linalg.norm(direction)
    polar = math.acos(min(max(y, -1.0), 1.0))
    if abs(y) > 0.9:  # where the arc cosine loses its digits
        polar = math.asin(min(math.hypot(x, z), 1.0))
        polar = polar if y > 0 else math.pi - polar
    row = polar / math.pi * height - 0.5
    column = math.atan2(x, -z) / (2 * math.pi) * width - 0.5
    shares = [max(0.0, 1 - abs(min(max(row, 0), height - 1) - r)) for r in range(height)]
    ring = np.array(shares) @ radiance
    if math.hypot(x, z) < ROUNDINGS * epsilon:
        return ring.min(), ring.max(), ring.max()
    left = math.floor(column)
    value = sum(max(0.0, 1 - abs(column - c)) * ring[c % width] for c in range(left - 1, left + 3))
    used = [r for r in range(height) if shares[r] > 0]
    around = radiance[max(used[0] - 1, 0) : used[-1] + 2]
    around = np.take(around, range(left - 1, left + 3), axis=1, mode="wrap")
    # Rounding moves the position by about epsilon times the number of texels in each direction.
    moved = np.ptp(around) * (height + width / math.hypot(x, z))
    return value, value, around.max() + moved


def _mean(radiance: float, precision: Precision) -> Outcome:
    even = np.full((HEIGHT, 2 * HEIGHT), radiance)
    found, _ = precision.evaluate(lambda map_: environment.spherical_mean(map_), even)
    right = float(precision.rounded(radiance))
    return Outcome(Compared(found, right, right, precision.tolerance(right)))


def _rotated(radiance: float, precision: Precision) -> Outcome:
    even = np.full((HEIGHT, 2 * HEIGHT), radiance)
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    found, _ = precision.evaluate(lambda map_: environment.rotate(map_, turn, 16, 32), even)
    right = float(precision.rounded(radiance))
    return Outcome(Compared(found, right, right, precision.tolerance(right)))
