"""Cases for D, S and M of scenes on the fly: sums over levels of a light, under extreme lights.

The reference sums the same level's texels in double precision, one surface after another, and
looks M up in maps that are reduced one by one.
"""

import functools
import math
from typing import Any

import numpy as np
import tensorflow as tf

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import environment, shading
from lime_keras.synthesis import shading as synthesis_shading

from ..lights import extreme, unit
from ..precisions import ROUNDINGS, SINGLE, XLA, Precision
from .shading import slow_specular

_ROWS = 128
_SIDE = 4
_EXPONENTS = {"0": 0.0, "1e-6": 1e-6, "1": 1.0, "300": 300.0, "1e3": 1e3, "1e6": 1e6}
_LEVELS = {"0": 16, "1e-6": 16, "1": 16, "300": 32, "1e3": 64, "1e6": 128}
"""Rows of the level that each exponent is summed over."""
_QUICK = ("0", "1", "300")
"""Exponents tried without XLA, which needs the larger levels to be summed piece by piece."""
_CAMERA = np.array([5.0, 4.0, 2.0, 2.5], np.float32)
_COARSEST_MIRROR = 4


@functools.cache
def _lights() -> dict[str, np.ndarray]:
    """Return maps `(128, 256)` of linear radiance by name."""
    texels = {
        "in front": (52, 140),
        "behind": (56, 12),
        "at the pole": (0, 40),
        "at the seam": (48, 255),
    }
    return extreme(_ROWS, 1e4, texels)


def cases() -> list[Case]:
    """Return the cases of D, S and M of scenes on the fly."""
    out = []
    for precision in (SINGLE, XLA):
        exponents = _tried(precision)
        for light in _lights():
            for s in exponents:
                measure = functools.partial(_specular, light, s, precision)
                out.append(Case("S on the fly", f"s = {s}, {light}", precision.name, measure))
            levels = {_LEVELS[s]: s for s in exponents}
            for rows, s in levels.items():
                measure = functools.partial(_diffuse, light, s, precision)
                out.append(Case("D on the fly", f"{rows} rows, {light}", precision.name, measure))
            measure = functools.partial(_mirror, light, precision)
            out.append(Case("M on the fly", light, precision.name, measure))
    return out


def _tried(precision: Precision) -> tuple[str, ...]:
    return tuple(_EXPONENTS) if precision.compiled else _QUICK


@functools.cache
def _surfaces() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return n and o in the map's frame, `(16, 3)`, and the variance of each pixel's normals.

    A normal is random, grazing, or the viewing direction itself.
    """
    view = shading.view_directions(_CAMERA, _SIDE, _SIDE).reshape(-1, 3)
    rng = np.random.default_rng(1)
    normal = unit(view + 0.9 * unit(rng.normal(size=view.shape)))
    across = unit(np.cross(normal[:4], view[:4]))
    normal[:4] = unit(across + 1e-4 * view[:4])
    normal[4:8] = view[4:8]
    variance = np.resize([0.0, 1e-6, 0.01, 1.0], len(view))
    return np.asarray(normal, np.float32), view, np.asarray(variance, np.float32)


@functools.cache
def _found(precision: Precision) -> dict[tuple[str, str], np.ndarray]:
    """Return D, S and M `(3, 16)` by light and exponent, computed in one batch."""
    names = [(light, s) for light in _lights() for s in _tried(precision)]
    normal, _, variance = _surfaces()
    count = len(names)
    first = np.arange(2)[:, None, None] == 0
    there = np.broadcast_to(first, (count, 2, _SIDE, _SIDE))
    exponent = np.array([_EXPONENTS[s] for _, s in names], np.float32)
    surfaces = (count, 2, _SIDE, _SIDE)
    arrays = (
        np.broadcast_to(normal.reshape(_SIDE, _SIDE, 3), (*surfaces, 3)),
        np.broadcast_to(variance.reshape(_SIDE, _SIDE), surfaces),
        np.ones((count, _SIDE, _SIDE), np.float32),
        np.tile(_CAMERA, (count, 1)),
        np.asarray([_lights()[light] for light, _ in names], np.float32),
        np.tile(np.eye(3, dtype=np.float32), (count, 1, 1)),
        exponent,
        *synthesis_shading.pieces(there, exponent),
    )

    def lit(*given: Any) -> Any:
        arguments = [*given[:7], synthesis_shading.Pieces(*given[7:])]
        return synthesis_shading.layers(*arguments)

    run = tf.function(lit, jit_compile=True) if precision.compiled else lit
    images = np.asarray([np.asarray(image) for image in run(*map(tf.constant, arrays))], np.float64)
    images = images.reshape(3, count, -1)
    return {name: images[:, row] for row, name in enumerate(names)}


@functools.cache
def _level(light: str, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return directions `(T, 3)`, energies and lengths of the first moments of a level's texels."""
    radiance = SINGLE.rounded(_lights()[light])
    energy = radiance * environment.solid_angles(_ROWS, 2 * _ROWS)
    moments = environment.directions(_ROWS, 2 * _ROWS) * energy[..., None]
    step = _ROWS // rows
    blocks = (rows, step, 2 * rows, step)
    energy = energy.reshape(blocks).sum((1, 3)).ravel()
    moments = moments.reshape(*blocks, 3).sum((1, 3)).reshape(-1, 3)
    lit = energy > 0
    length = np.linalg.norm(moments[lit], axis=-1)
    return moments[lit] / length[:, None], energy[lit], length


def _diffuse(light: str, s: str, precision: Precision) -> Outcome:
    normal, _, _ = _surfaces()
    i, _, moment = _level(light, _LEVELS[s])
    n = np.asarray(normal, np.float64)
    right = np.maximum(n @ i.T, 0) @ moment / math.pi
    size = np.abs(n) @ np.abs(i.T) @ moment / math.pi
    found = _found(precision)[light, s][0]
    return Outcome(precision.compare(found, right, right, size, terms=len(moment)))


def _specular(light: str, s: str, precision: Precision) -> Outcome:
    """Try S of lobes widened by the variance of the normals."""
    normal, view, variance = _surfaces()
    i, energy, _ = _level(light, _LEVELS[s])
    rows = []
    for n, o, spread in zip(
        np.asarray(normal, np.float64), view, np.asarray(variance, np.float64), strict=True
    ):
        widened = _EXPONENTS[s] / (1 + _EXPONENTS[s] * spread / 8)
        rows.append(slow_specular(n, o, widened, i, energy, precision))
    right, size = np.array(rows).T
    tolerance = precision.tolerance(size, terms=max(len(energy), 1))
    return Outcome(Compared(_found(precision)[light, s][1], right, right, tolerance))


def _mirror(light: str, precision: Precision) -> Outcome:
    """Try M between the two levels whose texels are as wide as the mirror directions vary.

    An error of a direction moves the look-up by as many texels as a map has in a turn.
    """
    normal, view, variance = _surfaces()
    n = np.asarray(normal, np.float64)
    mirrored = 2 * np.sum(n * view, axis=-1, keepdims=True) * n - view
    angles = environment.solid_angles(_ROWS, 2 * _ROWS)
    radiance = SINGLE.rounded(_lights()[light])
    right, spread = [], []
    for towards, wide in zip(mirrored, np.asarray(variance, np.float64), strict=True):
        width = math.sqrt(2 * max(wide, 1e-9))
        level = math.log2(math.pi / width) - math.log2(_COARSEST_MIRROR)
        level = min(max(level, 0.0), math.log2(_ROWS / _COARSEST_MIRROR))
        lower = min(math.floor(level), round(math.log2(_ROWS / _COARSEST_MIRROR)) - 1)
        values = []
        for k in (lower, lower + 1):
            rows = _COARSEST_MIRROR * 2**k
            step = _ROWS // rows
            blocks = (rows, step, 2 * rows, step)
            energy = (radiance * angles).reshape(blocks).sum((1, 3))
            map_of_level = energy / environment.solid_angles(rows, 2 * rows)
            values.append(environment.lookup(map_of_level, towards[None])[0])
            spread.append(map_of_level.max() * 2 * rows)
        right.append(values[0] + (level - lower) * (values[1] - values[0]))
    steep = np.reshape(spread, (-1, 2)).max(1)
    # Next to a pole a column is narrower than its row by the distance from the axis.
    aside = np.maximum(np.linalg.norm(mirrored[:, [0, 2]], axis=1), 1e-3)
    expected = np.array(right)
    tolerance = ROUNDINGS * precision.epsilon * (expected + steep / aside)
    return Outcome(Compared(_found(precision)[light, "1"][2], expected, expected, tolerance))
