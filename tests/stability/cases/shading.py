"""Cases for D and S under extreme lights, compared with sums over explicit half vectors."""

import functools
import math

import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import shading

from ..lights import EXPONENTS, HEIGHT, lights, normaliser, surface, texels
from ..precisions import ARRAYS, NUMPY_DOUBLE, ROUNDINGS, Precision


def cases() -> list[Case]:
    """Return the cases of D and S."""
    out = []
    for light in lights():
        for precision in ARRAYS:
            measure = functools.partial(_diffuse, light, precision)
            out.append(Case("D", light, precision.name, measure))
            for name, s in EXPONENTS.items():
                measure = functools.partial(_specular, light, precision, s)
                out.append(Case("S", f"s = {name}, {light}", precision.name, measure))
    for name in ("0", "1", "1e3"):
        measure = functools.partial(_furnace, EXPONENTS[name])
        case = f"s = {name}, exactly 1 in a furnace at n = o"
        out.append(Case("S", case, NUMPY_DOUBLE.name, measure))
    return out


def _diffuse(light: str, precision: Precision) -> Outcome:
    normal, _ = surface()

    def shaded(normal: np.ndarray, radiance: np.ndarray) -> np.ndarray:
        return shading.diffuse(normal, *shading.texels(radiance))

    found, _ = precision.evaluate(shaded, normal, lights()[light])
    direction, energy = texels(light, precision)
    n = precision.rounded(normal)
    right = np.maximum(n @ direction.T, 0) @ energy / math.pi
    size = np.abs(n) @ np.abs(direction.T) @ energy / math.pi
    return Outcome(Compared(found, right, right, precision.tolerance(size, terms=len(energy))))


def _specular(light: str, precision: Precision, s: float) -> Outcome:
    normal, view = surface()

    def shaded(normal: np.ndarray, view: np.ndarray, radiance: np.ndarray) -> np.ndarray:
        return shading.specular(normal, view, s, *shading.texels(radiance))

    found, _ = precision.evaluate(shaded, normal, view, lights()[light])
    directions = precision.rounded(normal), precision.rounded(view)
    rows = [
        slow_specular(n, o, s, *texels(light, precision), precision)
        for n, o in zip(*directions, strict=True)
    ]
    right, size = np.array(rows).T
    tolerance = precision.tolerance(size, terms=HEIGHT * 2 * HEIGHT)
    return Outcome(Compared(found, right, right, tolerance))


def slow_specular(
    n: np.ndarray, o: np.ndarray, s: float, i: np.ndarray, energy: np.ndarray, precision: Precision
) -> tuple[float, float]:
    """Return S of one pixel, and the sum of its terms' magnitudes times their condition numbers.

    The condition numbers are those of `reflectance`. A light on the horizon may count or not.

    Args:
        n: normal, unit, `(3,)`.
        o: direction to the viewer, unit, `(3,)`.
        s: exponent, at least 0.
        i: unit directions of the lights, `(T, 3)`.
        energy: linear radiance × solid angle of each light, `(T,)`.
        precision: precision in which S was computed.
    """
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
    constant = normaliser(s)
    return constant * np.sum(lobe * energy * lit), constant * np.sum(sizes * energy)


def _furnace(s: float) -> Outcome:
    """Try S in a white furnace, where it must be 1.

    The normal points to the pole, so that no row of texels crosses the horizon. The tolerance is
    twice the error of the midpoint rule, which is a 24th of the second derivatives times the square
    of a texel's height. These derivatives are about s / 4 for the lobe and 1 for sin θ.
    """
    height = 128
    up = np.array([[0.0, 1.0, 0.0]])
    found = shading.specular(up, up, s, *shading.texels(np.ones((height, 2 * height))))
    return Outcome(Compared(found, 1.0, 1.0, (s / 4 + 1) * (math.pi / height) ** 2 / 12))
