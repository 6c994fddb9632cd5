"""D, S and M under the strangest lights, against sums that take half vectors literally."""

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from lime_keras import environment, shading

from .precisions import ARRAYS, NUMPY_DOUBLE, NUMPY_SINGLE, ROUNDINGS, Precision
from .verdicts import Case, Compared, Outcome, refusal

_HEIGHT = 32
_EXPONENTS = {"0": 0.0, "1e-6": 1e-6, "1": 1.0, "1e3": 1e3, "1e6": 1e6}
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
    """Every case of these parts."""
    out = []
    for light in _lights():
        for precision in ARRAYS:
            of_light = (light, precision)
            out.append(_case("D", light, precision, functools.partial(_diffuse, *of_light)))
            out.append(_case("M", light, precision, functools.partial(_mirror, *of_light)))
            for name, s in _EXPONENTS.items():
                measure = functools.partial(_specular, *of_light, s)
                out.append(_case("S", f"s = {name}, {light}", precision, measure))
    for place, directions in _POLES_AND_SEAM.items():
        for precision in ARRAYS:
            measure = functools.partial(_mirror_at, directions, precision)
            out.append(_case("M", f"{place} of the map", precision, measure))
    for name in ("0", "1", "1e3"):
        measure = functools.partial(_furnace, _EXPONENTS[name])
        case = f"s = {name}, exactly 1 in a furnace at n = o"
        out.append(_case("S", case, NUMPY_DOUBLE, measure))
    return out + _maps() + _refusals()


def _case(part: str, name: str, precision: Precision, measure: Callable[[], Outcome]) -> Case:
    return Case(part, name, precision.name, measure)


def _maps() -> list[Case]:
    """What is measured of a map itself."""
    out = []
    for radiance in (0.0, 1e-8, 1.0, 1e8):
        for precision in ARRAYS:
            measure = functools.partial(_mean, radiance, precision)
            out.append(_case("map", f"mean of radiance {radiance:g}", precision, measure))
            measure = functools.partial(_rotated, radiance, precision)
            out.append(_case("map", f"radiance {radiance:g} rotated", precision, measure))
    return out


def _refusals() -> list[Case]:
    takers: dict[str, Callable[[np.ndarray], Any]] = {
        "texels": lambda radiance: shading.texels(radiance),
        "mirror": lambda radiance: shading.mirror(*_surface()[:2], radiance),
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
    radiance = np.ones((_HEIGHT, 2 * _HEIGHT), np.float32)
    radiance[5, 7] = value
    return refusal(lambda: take(radiance), str(np.float32(value)), "row 5, column 7", "repair")


@functools.cache
def _lights() -> dict[str, np.ndarray]:
    """Maps `(32, 64)` by name."""
    shape = (_HEIGHT, 2 * _HEIGHT)
    uneven = np.random.default_rng(0).exponential(size=shape)

    def one_texel(row: int, column: int) -> np.ndarray:
        out = np.zeros(shape)
        out[row, column] = 100.0
        return out

    return {
        "black": np.zeros(shape),
        "furnace": np.ones(shape),
        "one texel in front": one_texel(13, 36),
        "one texel behind": one_texel(14, 3),
        "one texel at the pole": one_texel(0, 10),
        "one texel at the seam": one_texel(12, 63),
        "radiance 1e-8": 1e-8 * uneven,
        "radiance 1e8": 1e8 * uneven,
    }


@functools.cache
def _surface() -> tuple[np.ndarray, np.ndarray]:
    """Normals and directions to the viewer, `(N, 3)` each: random, grazing and along the axes."""
    rng = np.random.default_rng(1)
    normal = _unit(rng.normal(size=(24, 3)))
    view = _unit(normal + 0.9 * _unit(rng.normal(size=(24, 3))))
    across = _unit(np.cross(normal[:8], view[:8]))
    grazing = _unit(across + 1e-4 * normal[:8])
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    n = np.concatenate([normal, normal[:8], axes, axes])
    o = np.concatenate([view, grazing, axes, np.roll(axes, 1, axis=0)])
    return n, o


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _diffuse(light: str, precision: Precision) -> Outcome:
    normal, _ = _surface()

    def shaded(normal: np.ndarray, radiance: np.ndarray) -> np.ndarray:
        return shading.diffuse(normal, *shading.texels(radiance))

    found, _ = precision.evaluate(shaded, normal, _lights()[light])
    direction, energy = _slow_texels(light, precision)
    n = precision.rounded(normal)
    right = np.maximum(n @ direction.T, 0) @ energy / math.pi
    size = np.abs(n) @ np.abs(direction.T) @ energy / math.pi
    return Outcome(Compared(found, right, right, precision.tolerance(size, terms=len(energy))))


def _specular(light: str, precision: Precision, s: float) -> Outcome:
    normal, view = _surface()

    def shaded(normal: np.ndarray, view: np.ndarray, radiance: np.ndarray) -> np.ndarray:
        return shading.specular(normal, view, s, *shading.texels(radiance))

    found, _ = precision.evaluate(shaded, normal, view, _lights()[light])
    rows = [
        _slow_specular(n, o, s, light, precision)
        for n, o in zip(precision.rounded(normal), precision.rounded(view), strict=True)
    ]
    right, size = np.array(rows).T
    tolerance = precision.tolerance(size, terms=_HEIGHT * 2 * _HEIGHT)
    return Outcome(Compared(found, right, right, tolerance))


def _slow_specular(
    n: np.ndarray, o: np.ndarray, s: float, light: str, precision: Precision
) -> tuple[float, float]:
    """S of one pixel, and the sum of its terms' sizes times their condition.

    The condition is that of `extremes_reflectance`; a light on the horizon may be lit or not.
    """
    i, energy = _slow_texels(light, precision)
    dividend, added = (i + o) @ n, np.abs(i) @ np.abs(n) + np.abs(o) @ np.abs(n)
    length = np.linalg.norm(i + o, axis=1)
    log = np.log(np.clip(dividend / np.maximum(length, 1e-300), 1e-300, 1))
    lobe = np.exp(s * log)
    condition = added / np.maximum(np.abs(dividend), 1e-300) - log
    condition += (1 + np.abs(i) @ np.abs(o)) / np.maximum(length, 1e-150) ** 2
    moved = np.exp(np.minimum(s * (log + condition * precision.epsilon), 0)) - lobe
    largest = 1 / (ROUNDINGS * precision.epsilon)
    sizes = np.minimum(lobe + moved / precision.epsilon, largest)
    slack = ROUNDINGS * precision.epsilon * added
    towards, above = i @ n, (dividend > 0) & (length > 0)
    lit = (towards > 0) & above
    doubtful = (np.abs(towards) <= slack) | (np.abs(dividend) <= slack)
    sizes = np.where(doubtful, np.minimum(lobe, 1) * largest, sizes * lit)
    constant = (s + 2) / (8 * math.pi * (1 - 2 ** (-(s + 2) / 2)))
    return constant * np.sum(lobe * energy * lit), constant * np.sum(sizes * energy)


def _mirror(light: str, precision: Precision) -> Outcome:
    normal, view = _surface()
    found, _ = precision.evaluate(
        lambda n, o, radiance: shading.mirror(n, o, radiance), normal, view, _lights()[light]
    )
    n, o = precision.rounded(normal), precision.rounded(view)
    mirrored = 2 * np.sum(n * o, axis=-1, keepdims=True) * n - o
    return Outcome(_looked_up(found, mirrored, _lights()[light], precision))


def _mirror_at(directions: list[tuple[float, float, float]], precision: Precision) -> Outcome:
    """M of a mirror faced at right angles, which shows the light behind its viewer."""
    radiance = _lights()["radiance 1e-8"]
    facing = _unit(np.array(directions))
    found, _ = precision.evaluate(
        lambda n, radiance: shading.mirror(n, n, radiance), facing, radiance
    )
    return Outcome(_looked_up(found, precision.rounded(facing), radiance, precision))


def _looked_up(
    found: np.ndarray, direction: np.ndarray, radiance: np.ndarray, precision: Precision
) -> Compared:
    """Beside slow look-ups."""
    radiance = precision.rounded(radiance)
    rows = [_slow_look_up(d, radiance, precision.epsilon) for d in direction]
    low, high, size = np.array(rows).T
    return Compared(found, low, high, precision.tolerance(size))


def _slow_look_up(
    direction: np.ndarray, radiance: np.ndarray, epsilon: float
) -> tuple[float, float, float]:
    """Least and most that bilinear interpolation may give, and the size of its rounding.

    Texel by texel, from the angles' definition. A direction that rounding cannot tell from a pole
    may have any longitude.
    """
    height, width = radiance.shape
    x, y, z = direction / np.linalg.norm(direction)
    row = math.acos(min(max(y, -1.0), 1.0)) / math.pi * height - 0.5
    if abs(y) > 0.9:
        polar = math.asin(min(math.hypot(x, z), 1.0))
        row = (polar if y > 0 else math.pi - polar) / math.pi * height - 0.5
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
    # By rounding, the position moves by some of the texels' number times epsilon.
    moved = np.ptp(around) * (height + width / math.hypot(x, z))
    return value, value, around.max() + moved


@functools.cache
def _slow_texels(light: str, precision: Precision) -> tuple[np.ndarray, np.ndarray]:
    """A map as lights: directions `(T, 3)`, energies `(T,)`; texel by texel."""
    radiance = precision.rounded(_lights()[light])
    height, width = radiance.shape
    directions, energies = [], []
    for row, column in np.ndindex(height, width):
        theta, phi = math.pi * (row + 0.5) / height, 2 * math.pi * (column + 0.5) / width
        directions.append(
            (
                math.sin(theta) * math.sin(phi),
                math.cos(theta),
                -math.sin(theta) * math.cos(phi),
            )
        )
        # cos a − cos b, without its cancellation.
        area = 2 * math.sin(theta) * math.sin(math.pi / (2 * height)) * (2 * math.pi / width)
        energies.append(area * radiance[row, column])
    return np.array(directions), np.array(energies)


def _furnace(s: float) -> Outcome:
    """S = 1. Along the pole no row of texels straddles the horizon.

    The lobe's second derivative is some s / 4 of it at most, and sin θ's of the size of 1; the
    midpoint rule errs by a 24th of them times the texel's square.
    """
    height = 128
    up = np.array([[0.0, 1.0, 0.0]])
    found = shading.specular(up, up, s, *shading.texels(np.ones((height, 2 * height))))
    return Outcome(Compared(found, 1.0, 1.0, (s / 4 + 1) * (math.pi / height) ** 2 / 12))


def _mean(radiance: float, precision: Precision) -> Outcome:
    even = np.full((_HEIGHT, 2 * _HEIGHT), radiance)
    found, _ = precision.evaluate(lambda map_: environment.spherical_mean(map_), even)
    right = float(precision.rounded(radiance))
    return Outcome(Compared(found, right, right, precision.tolerance(right)))


def _rotated(radiance: float, precision: Precision) -> Outcome:
    even = np.full((_HEIGHT, 2 * _HEIGHT), radiance)
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    found, _ = precision.evaluate(lambda map_: environment.rotate(map_, turn, 16, 32), even)
    right = float(precision.rounded(radiance))
    return Outcome(Compared(found, right, right, precision.tolerance(right)))
