"""Cases for the live page's modules under Node: its tables of D and S, its light, its colours."""

import functools
import math
from typing import Any

import mpmath
import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import environment

from .. import page_modules, srgb_standard
from ..lights import HEIGHT, lights, normaliser
from ..precisions import NUMPY_DOUBLE, NUMPY_SINGLE, ROUNDINGS

JAVASCRIPT = "JavaScript"  # precision of these cases, which need Node.js
_SIZE = 12
_LEAST_Z, _TAIL, _STEPS, _WIDE = -0.2, 1e-5, 4096, 32
"""What the page leaves out or rounds: normals turned away, tails of lobes, the lobe's table."""
_EXPONENTS = (0.0, 1e-6, 1.0, 2.5, 32.0, 33.0, 1e3, 1e6)
_VALUES = (0.0, 1e-30, 1e-6, 0.0031308, 0.0031309, 0.04045, 0.04046, 0.18, 0.5, 0.999, 1.0)
_BEYOND = {"-1": -1.0, "1.5": 1.5, "1e30": 1e30, "-1e30": -1e30}
_ANGLES = (0.0, 1e-9, 0.1, math.pi, -math.pi, 2 * math.pi, -7.0, 100.0)

_SCRIPT = """
const shading = await import(page + "shading.js");
const panorama = await import(page + "panorama.js");
const colour = await import(page + "colour.js");
const maps = names.map((_, at) => {
  return { width, height, data: radiance.subarray(at * width * height, (at + 1) * width * height) };
});
return {
  normals: shading.tableNormals(size),
  diffuse: maps.map((map) => shading.diffuse(map, size)),
  specular: maps.map((map) => exponents.map((s) => shading.specular(map, s, size))),
  normaliser: exponents.map(shading.normaliser),
  turned: angles.map((angle) => panorama.turned(maps[maps.length - 2], angle, 2).data),
  linear: values.map(colour.toLinear),
  srgb: [...values, ...beyond].map(colour.toSrgb),
  level: [...values, ...beyond].map(colour.toLevel),
  solid: Array.from({ length: height }, (_, row) => panorama.solidAngle(row, width, height)),
};
"""


def cases() -> list[Case]:
    """Return the cases of the page's modules."""
    out = []

    def add(part: str, name: str, measure: Any, *arguments: Any) -> None:
        out.append(Case(part, name, JAVASCRIPT, functools.partial(measure, *arguments)))

    for light in lights():
        add("page's D", light, _diffuse, light)
        for s in _EXPONENTS:
            add("page's S", f"s = {s:g}, {light}", _specular, light, s)
    for index, s in enumerate(_EXPONENTS):
        add("page's S", f"normaliser, s = {s:g}", _normaliser, index)
    for index, angle in enumerate(_ANGLES):
        add("page's light", f"turned by {angle:g}", _turned, index)
    add("page's light", "solid angles", _solid)
    for index, value in enumerate(_VALUES):
        add("page's colours", f"sRGB {value:g} to linear", _linear, index)
    for index, name in enumerate([f"{value:g}" for value in _VALUES] + list(_BEYOND)):
        add("page's colours", f"linear {name} to sRGB", _srgb, index)
        add("page's colours", f"linear {name} to a level", _level, index)
    return out


@functools.cache
def _found() -> dict[str, Any]:
    """Return what all functions answer, from one run of Node."""
    radiance = np.stack(list(lights().values())).astype(np.float32)
    return page_modules.run(
        _SCRIPT,
        radiance=radiance.ravel(),
        names=list(lights()),
        width=2 * HEIGHT,
        height=HEIGHT,
        size=_SIZE,
        exponents=list(_EXPONENTS),
        angles=list(_ANGLES),
        values=list(_VALUES),
        beyond=list(_BEYOND.values()),
    )


@functools.cache
def _normals() -> np.ndarray:
    """Return the normals of the table, `(144, 3)`, by Lambert's map in double precision."""
    centres = (2 * np.arange(_SIZE) + 1) / _SIZE - 1
    u, v = np.meshgrid(centres, centres)
    square = u**2 + v**2
    scale = np.sqrt(2 - square)
    return np.stack([u * scale, v * scale, 1 - square], axis=-1).reshape(-1, 3)


@functools.cache
def _lights(light: str, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Return directions `(T, 3)` and energies `(T,)` of `step` × `step` texels taken as one."""
    radiance = NUMPY_SINGLE.rounded(lights()[light])
    energy = radiance * environment.solid_angles(HEIGHT, 2 * HEIGHT)
    moments = environment.directions(HEIGHT, 2 * HEIGHT) * energy[..., None]
    blocks = (HEIGHT // step, step, 2 * HEIGHT // step, step)
    energy = energy.reshape(blocks).sum((1, 3)).ravel()
    moments = moments.reshape(*blocks, 3).sum((1, 3)).reshape(-1, 3)
    lit = energy > 0
    length = np.linalg.norm(moments[lit], axis=-1, keepdims=True)
    return moments[lit] / length, energy[lit]


def _diffuse(light: str) -> Outcome:
    found = np.asarray(_found()["diffuse"][list(lights()).index(light)], np.float64)
    i, energy = _lights(light, 2)
    n = _normals()
    seen = n[:, 2] >= _LEAST_Z
    right = np.maximum(n @ i.T, 0) @ energy / math.pi * seen
    size = np.abs(n) @ np.abs(i.T) @ energy / math.pi
    return Outcome(NUMPY_SINGLE.compare(found, right, right, size, terms=len(energy)))


def _specular(light: str, s: float) -> Outcome:
    """Try S for a distant viewer, next to the horizons of h and i within rounding.

    The tolerance has the lobe's tail, the error of its table, which is linear between 4,096 steps,
    and rounding, which a relative error of h·n multiplies by s.
    """
    row = list(lights()).index(light)
    found = np.asarray(_found()["specular"][row][_EXPONENTS.index(s)], np.float64)
    i, energy = _lights(light, 2 if s <= _WIDE else 1)
    n = _normals()
    seen = (n[:, 2] >= _LEAST_Z)[:, None]
    length = np.sqrt(np.maximum(2 + 2 * i[:, 2], 0))
    met = length > 1e-6
    half = np.where(met, (n @ i.T + n[:, 2:]) / np.where(met, length, 1), 0)
    lit = seen & met & (half > 0) & (n @ i.T > 0)
    lobe = np.where(lit, np.maximum(half, 1e-300) ** s, 0)
    slack = ROUNDINGS * NUMPY_SINGLE.epsilon
    doubtful = seen & ((np.abs(n @ i.T) < slack) | (np.abs(half) * length < slack))
    least = _TAIL ** (1 / s) if s else 0.0
    step = (1 - least) / _STEPS
    # Between two steps a chord of x^s lies off by at most its rise; where it bends little, by an
    # eighth of the bend.
    low, high = (np.clip(half + side * step, 0, 1) for side in (-1, 1))
    rise = np.where(low > 0, low, 0) ** s - high**s
    bend = s * abs(s - 1) * np.maximum(low, 1e-100) ** min(s - 2, 0) * step**2
    table = np.minimum(np.abs(rise), bend)
    relative = slack * (1 + 1 / np.maximum(half * length, slack))
    moved = np.minimum(1, lobe * np.expm1(np.minimum(s * relative, 30)))
    error = np.where(lit, table + np.minimum(_TAIL, lobe) + moved, 0) + doubtful
    constant = normaliser(s)
    right = constant * lobe @ energy
    size = NUMPY_SINGLE.tolerance(right, terms=len(energy))
    return Outcome(Compared(found, right, right, constant * error @ energy + size))


def _normaliser(index: int) -> Outcome:
    with mpmath.workdps(50):
        s = mpmath.mpf(_EXPONENTS[index])
        right = float((s + 2) / (8 * mpmath.pi * (1 - 2 ** (-(s + 2) / 2))))
    found = np.array(_found()["normaliser"][index])
    return Outcome(NUMPY_DOUBLE.compare(found, right, right, right))


def _turned(index: int) -> Outcome:
    """Try a light turned by any angle: linear between columns, and as bright as `factor` says."""
    angle = _ANGLES[index]
    light = NUMPY_SINGLE.rounded(list(lights().values())[-2])
    found = np.asarray(_found()["turned"][index], np.float64).reshape(light.shape)
    shift = angle / (2 * math.pi) * light.shape[1]
    whole = math.floor(shift)
    share = shift - whole
    near, far = (np.roll(light, whole + side, axis=1) for side in (0, 1))
    right = 2 * (near * (1 - share) + far * share)
    # The angle's rounding error moves columns by as much as it is long.
    moved = (abs(shift) + light.shape[1]) * NUMPY_DOUBLE.epsilon * ROUNDINGS
    tolerance = NUMPY_SINGLE.tolerance(right) + 4 * moved * light.max()
    return Outcome(Compared(found, right, right, tolerance))


def _solid() -> Outcome:
    rows = np.arange(HEIGHT) + 0.5
    width = math.pi / HEIGHT
    right = 2 * np.sin(rows * width) * math.sin(width / 2) * width
    return Outcome(NUMPY_DOUBLE.compare(np.array(_found()["solid"]), right, right, HEIGHT * right))


def _linear(index: int) -> Outcome:
    right = srgb_standard.decoded(np.array(_VALUES[index]))
    found = np.array(_found()["linear"][index])
    return Outcome(NUMPY_DOUBLE.compare(found, right, right, 4 * right))


def _encoded(index: int) -> float:
    value = [*_VALUES, *_BEYOND.values()][index]
    return float(srgb_standard.encoded(np.array(np.clip(value, 0, 1))))


def _srgb(index: int) -> Outcome:
    right = _encoded(index)
    found = np.array(_found()["srgb"][index])
    return Outcome(NUMPY_DOUBLE.compare(found, right, right, right + 0.055))


def _level(index: int) -> Outcome:
    """Try a level, from a table of 4,096 steps of the root: within one of the exact level."""
    right = 255 * _encoded(index)
    found = np.array(float(_found()["level"][index]))
    return Outcome(Compared(found, right, right, 1.0))
