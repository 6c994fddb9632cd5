"""Cases for the law of lights drawn on the fly, where its uniform numbers are extreme."""

import functools
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import environment
from lime_keras.synthesis import light_law
from lime_keras.synthesis.light_law import LAMP_PARTS, LAMPS, MAPS, NUMBERS, LightDraw

from ..precisions import NUMPY_SINGLE

_SETTINGS = {"maps": 0.2, "canopies": 0.5, "lamps": 0.6, "windows": 0.75, "studio": 0.85}
_SETTINGS |= {"night": 0.95}
"""A number that chooses each setting."""
_FILLS = {"0": 0.0, "2^-53": 2.0**-53, "1/2": 0.5, "1 - 2^-53": 1 - 2.0**-53}
"""Numbers in [0, 1) that a generator may return; all the others of a draw are the same."""
_SETTING = 1
_COLUMNS = 512
_BANK = cast(
    Any,
    SimpleNamespace(
        strong_direction=np.array([(0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (1, 0, 0)]),
        scale=np.array([1.0, 1e-3, 40.0, 1.0, 7.0], np.float32),
        radiance=np.zeros((5, 1, _COLUMNS), np.float16),
    ),
)
"""Maps whose strongest light is at a pole, in front, behind, or aside."""


def cases() -> list[Case]:
    """Return the cases of drawn lights."""
    measures: dict[str, Callable[[LightDraw], Outcome]] = {
        "parts of the power add up": _power,
        "unit directions at right angles": _directions,
        "a rotation": _rotation,
        "maps and columns that exist": _indices,
        "lamps of a size": _sizes,
    }
    return [
        Case(
            "law of lights",
            f"{setting}, all numbers {fill}, {name}",
            NUMPY_SINGLE.name,
            functools.partial(_tried, setting, fill, measure),
        )
        for setting in _SETTINGS
        for fill in _FILLS
        for name, measure in measures.items()
    ]


def _tried(setting: str, fill: str, measure: Callable[[LightDraw], Outcome]) -> Outcome:
    numbers = np.full(NUMBERS, _FILLS[fill])
    numbers[_SETTING] = _SETTINGS[setting]
    generator = cast(np.random.Generator, SimpleNamespace(random=lambda count: numbers[:count]))
    return measure(light_law.draw([generator], _BANK, np.arange(len(_BANK.scale))))


def _power(light: LightDraw) -> Outcome:
    found = np.sum(np.float64(light.weights) / _BANK.scale[light.maps])
    power = np.float64(light.lamps[..., LAMP_PARTS["power"]])
    right = environment.MEAN_RADIANCE
    least = min(light.weights.min(), power.min(), 0.0)
    value = NUMPY_SINGLE.compare(found + power.sum() + least, right, right, right, terms=LAMPS)
    return Outcome(value)


def _directions(light: LightDraw) -> Outcome:
    towards, across = (light.lamps[0, :, LAMP_PARTS[name]] for name in ("towards", "across"))
    found = np.stack([np.sum(a * b, 1) for a, b in ((towards,) * 2, (across,) * 2)])
    found = np.concatenate([found, np.sum(towards * across, 1)[None]])
    right = np.array([[1.0], [1.0], [0.0]])
    return Outcome(NUMPY_SINGLE.compare(found, right, right, 1.0, terms=3))


def _rotation(light: LightDraw) -> Outcome:
    found, right = light.rotation[0] @ light.rotation[0].T, np.eye(3)
    return Outcome(NUMPY_SINGLE.compare(found, right, right, 1.0, terms=3))


def _indices(light: LightDraw) -> Outcome:
    found = np.stack([light.maps[0], light.shifts[0]])
    highest = np.array([[len(_BANK.scale) - 1], [_COLUMNS - 1]])
    return Outcome(Compared(found, np.zeros((2, MAPS)), highest, 0.0))


def _sizes(light: LightDraw) -> Outcome:
    """Try half lengths and widths, which the kinds bound, and soft edges of at most 1.6 widths."""
    half, softness = (light.lamps[0, :, LAMP_PARTS[name]] for name in ("half", "softness"))
    low, high = (math.tan(math.radians(angle)) for angle in (0.5, 65.0))
    thinnest = 0.03 * math.tan(math.radians(10.0))
    least = np.array([low, min(low, thinnest), 0.0])
    found = np.concatenate([half, softness], axis=1)
    return Outcome(NUMPY_SINGLE.compare(found, least, [high, high, 1.6 * high], 2 * high))
