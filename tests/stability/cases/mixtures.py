"""Cases for mixtures of lights: extreme maps, and lamps of every kind at every place.

The reference mixes the maps and draws the lamps in double precision.
"""

import functools
import math
from typing import Any

import numpy as np
import tensorflow as tf

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome, joined
from lime_keras.optics import environment
from lime_keras.synthesis import mixing
from lime_keras.synthesis.light_law import LAMP_PARTS, LAMPS, MAPS, LightDraw

from ..lights import HEIGHT, lights, unit
from ..precisions import NUMPY_SINGLE, ROUNDINGS, SINGLE, XLA, Precision

_WIDTH = 2 * HEIGHT
_MAPS = {
    "black": np.zeros((HEIGHT, _WIDTH)),
    "furnace": np.ones((HEIGHT, _WIDTH)),
    "one texel of 65504": 655.04 * lights()["one texel in front"],
    "one texel at the pole": lights()["one texel at the pole"],
    "subnormal half floats": 2e-7 * lights()["furnace"],
    "uneven": 1e8 * lights()["radiance 1e-8"],
}
_NAMES = tuple(_MAPS)
_STORED = np.stack(list(_MAPS.values())).astype(np.float16)
_UNEVEN = _NAMES.index("uneven")

_FRONT, _UP, _DOWN, _SEAM = (0.1, 0.2, 1.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.1, -1.0)
_BULB, _CANOPY = math.radians(0.5), math.tan(math.radians(65))
_NO_BARS = -10.0
# Middle, half length and width, roundness, softness, bars' distance and half angle.
_LAMPS: dict[str, tuple[tuple[float, ...], tuple[float, float], float, float, float, float]] = {
    "bulb in front": (_FRONT, (_BULB, _BULB), 1, 0, 0, _NO_BARS),
    "bulb at the zenith": (_UP, (_BULB, _BULB), 1, 0, 0, _NO_BARS),
    "bulb at the nadir": (_DOWN, (_BULB, _BULB), 1, 0, 0, _NO_BARS),
    "bulb at the seam": (_SEAM, (_BULB, _BULB), 1, 0, 0, _NO_BARS),
    "lamp of 15°": (_FRONT, (0.27, 0.27), 1, 0, 0, _NO_BARS),
    "window with a bar each way": (_FRONT, (0.46, 0.2), 0, 0, 0, 0.02),
    "window with two bars each way": (_SEAM, (0.46, 0.46), 0, 0, 0.15, 0.01),
    "soft box": (_FRONT, (0.57, 0.3), 0, 0.48, 0, _NO_BARS),
    "strip of 40° × 1°": (_FRONT, (0.84, 0.02), 0, 0, 0, _NO_BARS),
    "tube at the zenith": (_UP, (0.84, 0.1), 1, 0, 0, _NO_BARS),
    "canopy above": (_UP, (_CANOPY, _CANOPY), 1, 1.6 * _CANOPY, 0, _NO_BARS),
    "canopy below": (_DOWN, (_CANOPY, 0.6 * _CANOPY), 0, _CANOPY, 0, _NO_BARS),
}


def cases() -> list[Case]:
    """Return the cases of mixed lights."""
    return [
        Case("mixture", name, precision.name, functools.partial(_compared, row, precision))
        for precision in (NUMPY_SINGLE, SINGLE, XLA)
        for row, name in enumerate(_scenes()[0])
    ]


@functools.cache
def _scenes() -> tuple[list[str], LightDraw]:
    """Return the names of the scenes, and their lights in single precision."""
    rows: dict[str, dict[str, Any]] = {}
    for index, name in enumerate(_NAMES):
        rows[f"map: {name}"] = {"maps": [index], "weights": [1.0]}
    for shift in (0, 1, HEIGHT, _WIDTH - 1):
        for mirrored in (False, True):
            name = f"map rolled by {shift}{', mirrored' * mirrored}"
            given = {"maps": [_UNEVEN], "weights": [1.0], "shifts": [shift], "mirrored": [mirrored]}
            rows[name] = given
    rows["three maps"] = {"maps": [1, 2, 5], "weights": [1.0, 1e-3, 2.0], "shifts": [0, 5, 63]}
    rows["weights from 1e-20 to 1e20"] = {"maps": [1, 5, 5], "weights": [1e-20, 1.0, 1e20]}
    for name in _LAMPS:
        rows[f"lamp: {name}"] = {"lamps": [name], "power": [1.0]}
    rows["six lamps"] = {"lamps": list(_LAMPS)[3:9], "power": [1e-6, 1.0, 0.1, 0.0, 3.0, 1e-3]}
    rows["map and bulb"] = {"maps": [_UNEVEN], "weights": [1e-2], "lamps": ["bulb in front"]}
    rows["map and bulb"]["power"] = [0.99]
    return list(rows), LightDraw(
        *(np.stack(part) for part in zip(*map(_light, rows.values()), strict=True))
    )


def _light(given: dict[str, Any]) -> tuple[np.ndarray, ...]:
    """Return the parts of a `LightDraw`; what is not given is 0."""

    def filled(name: str, dtype: type) -> np.ndarray:
        out: np.ndarray = np.zeros(MAPS, dtype)
        out[: len(given.get(name, []))] = given.get(name, [])
        return out

    lamps = np.zeros((LAMPS, 15), np.float32)
    lamps[:, LAMP_PARTS["towards"]], lamps[:, LAMP_PARTS["across"]] = (0, 0, 1), (1, 0, 0)
    added = zip(given.get("lamps", []), given.get("power", []), strict=True)
    for row, (name, power) in enumerate(added):
        towards, half, roundness, softness, bars_at, bars_half = _LAMPS[name]
        forth = unit(np.array([towards]))[0]
        level = unit(np.cross([[0.3, 1.0, 0.2]], [forth]))[0]
        parts = {
            "towards": forth,
            "across": level,
            "half": half,
            "roundness": roundness,
            "softness": softness,
            "bars_at": bars_at,
            "bars_half": bars_half,
            "power": power,
        }
        for part, value in parts.items():
            lamps[row, LAMP_PARTS[part]] = value
    whole, kind = filled("maps", np.int32), filled("mirrored", np.bool_)
    return whole, filled("weights", np.float32), filled("shifts", np.int32), kind, lamps, np.eye(3)


@functools.cache
def _found(precision: Precision) -> np.ndarray:
    """Return the lights of all scenes, `(B, 32, 64)`, computed in one batch."""
    light = _scenes()[1]
    if not precision.tensors:
        return np.asarray(mixing.mixed(_STORED, light), np.float64)

    def mixed(radiance: Any, *parts: Any) -> Any:
        return mixing.mixed(radiance, LightDraw(*parts))

    run = tf.function(mixed, jit_compile=True) if precision.compiled else mixed
    return np.asarray(run(*map(tf.constant, (_STORED, *light)))).astype(np.float64)


def _compared(row: int, precision: Precision) -> Outcome:
    light = LightDraw(*(part[row] for part in _scenes()[1]))
    right, tolerance = _mixed(light, precision.epsilon)
    found = _found(precision)[row]
    mean = environment.MEAN_RADIANCE * (right.max() > 0)
    measured = environment.spherical_mean(found)
    terms = np.sqrt(found.size) + ROUNDINGS
    return Outcome(
        joined(
            [
                Compared(found, right, right, tolerance),
                Compared(np.array(measured), mean, mean, terms * precision.epsilon * mean),
            ]
        )
    )


def _mixed(light: LightDraw, epsilon: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the light of one scene in double precision, and its tolerance, each `(32, 64)`."""
    shares = environment.solid_angles(HEIGHT, _WIDTH) / (4 * math.pi)
    total = np.zeros((HEIGHT, _WIDTH))
    tolerance = np.zeros_like(total)
    for index, weight, shift, mirrored in zip(
        light.maps, np.asarray(light.weights, np.float64), light.shifts, light.mirrored, strict=True
    ):
        stored = np.asarray(_STORED[index], np.float64)
        total += weight * np.roll(stored[:, ::-1] if mirrored else stored, shift, axis=1)
    for lamp in np.asarray(light.lamps, np.float64):
        lit, doubt = _lit(lamp, epsilon)
        mean = np.sum(shares * lit)
        [power] = lamp[LAMP_PARTS["power"]]
        total += power / mean * lit
        # The doubt about the texels at the edge is one about all that the lamp is divided among.
        tolerance += power / mean * (doubt + lit * np.sum(shares * doubt) / mean)
    tolerance += (ROUNDINGS + np.sqrt(total.size)) * epsilon * total
    mean = np.sum(shares * total)
    if mean == 0:
        return total, tolerance
    exposure = environment.MEAN_RADIANCE / mean
    return exposure * total, exposure * (tolerance + total * np.sum(shares * tolerance) / mean)


def _lit(lamp: np.ndarray, epsilon: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the radiance of a lamp over its largest, and what rounding may change in it."""
    texel = math.pi / HEIGHT
    polar = math.pi * (np.arange(HEIGHT)[:, None] + 0.5) / HEIGHT
    azimuth = 2 * math.pi * (np.arange(_WIDTH) + 0.5) / _WIDTH
    texels = np.stack(
        np.broadcast_arrays(
            np.sin(polar) * np.sin(azimuth), np.cos(polar), -np.sin(polar) * np.cos(azimuth)
        ),
        axis=-1,
    )
    part = {name: lamp[place] for name, place in LAMP_PARTS.items()}
    z = texels @ part["towards"]
    along = [texels @ part["across"], texels @ np.cross(part["towards"], part["across"])]
    half = np.maximum(part["half"], 0.65 * texel)
    corner = part["roundness"] * half[1]
    sharpness = 1 / max(float(part["softness"][0]), texel)
    beyond = [
        np.abs(side) - (length - corner) * z for side, length in zip(along, half, strict=True)
    ]
    outside = np.hypot(*(np.maximum(one, 0) for one in beyond))
    inside = np.minimum(np.maximum(*beyond), 0)
    ramps = [0.5 - (outside + inside - corner * z) * sharpness]
    ramps += [
        0.5 + (np.abs(np.abs(side) - at * z) - bar) * sharpness
        for side, at, bar in zip(along, part["bars_at"], part["bars_half"], strict=True)
    ]
    step = 3 * ROUNDINGS * epsilon * sharpness * (1 + half.max())
    doubt = sum(step * ((ramp > -step) & (ramp < 1 + step)) for ramp in ramps)
    return np.prod([np.clip(ramp, 0, 1) for ramp in ramps], axis=0), np.asarray(doubt)
