"""Cases for the laws of materials, where the random numbers are extreme."""

import functools
from typing import Any, cast

import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome, joined
from lime_keras.optics import material_law, shininess
from lime_keras.optics.material_law import LAWS, NATURAL
from lime_keras.optics.shininess import BIN_COUNT, BIN_WIDTH

from ..precisions import NUMPY_DOUBLE, NUMPY_SINGLE

_LAST = 1 - 2.0**-53
_ENDS = {"0": 0.0, "1/2": 0.5, "1 - 2^-53": _LAST}
_DRAWS = 20
# Range of m_s, and greatest m_d, of metals, which a kind of 0 is, and of dielectrics in ten
# standard deviations.
_METALS, _GREYS = (0.25, 0.95), 0.08
_DIELECTRICS = (0.045 / 1.8**10, 0.95)


class _Numbers:
    """A generator whose bin and first numbers are given; what follows is drawn.

    Args:
        seed: seed of what follows.
        exponent_bin: bin of the exponent.
        first: the first uniform numbers in [0, 1).
    """

    def __init__(self, seed: int, exponent_bin: int, first: list[float]):
        self._rng, self._bin, self._first = np.random.default_rng(seed), exponent_bin, first

    def integers(self, count: int) -> int:
        return self._bin

    def uniform(self, *limits: Any) -> Any:
        return self._rng.uniform(*limits) if limits or not self._first else self._first.pop(0)

    def normal(self) -> float:
        return self._rng.normal()


def cases() -> list[Case]:
    """Return the cases of drawn materials."""
    out = []
    for law in LAWS:
        for index in range(BIN_COUNT):
            for place in _ENDS:
                for kind in _ENDS:
                    measure = functools.partial(_drawn, law, index, place, kind)
                    case = f"{law}, bin {index} at {place}, kind {kind}"
                    out.append(Case("materials", case, NUMPY_DOUBLE.name, measure))
    for count in (1, 2, 1 << 10):
        measure = functools.partial(_table, count)
        case = f"natural table of {count}"
        out.append(Case("materials", case, NUMPY_SINGLE.name, measure))
    return out


def _drawn(law: str, index: int, place: str, kind: str) -> Outcome:
    """Try draws: s in its bin, numbers in range, and no more light reflected than received."""
    numbers, low, high = [], [], []
    edges = [10 ** (BIN_WIDTH * (index + end)) for end in (0, 1)]
    for seed in range(_DRAWS):
        rng = cast(np.random.Generator, _Numbers(seed, index, [_ENDS[place], _ENDS[kind]]))
        material = material_law.sample_material(rng, law)
        m_d, m_s = np.asarray(material.diffuse_albedo), material.specular_albedo
        most, range_of = 1.0, (0.0, 1.0)
        if law == NATURAL:
            most = _GREYS if kind == "0" else 1 - m_s
            range_of = _METALS if kind == "0" else _DIELECTRICS
        numbers += [m_d.min(), m_d.max(), m_s, material.exponent, material.ambient]
        low += [0.0, 0.0, range_of[0], edges[0], material_law.AMBIENT[0]]
        high += [most, most, range_of[1], edges[1], material_law.AMBIENT[1]]
    return Outcome(NUMPY_DOUBLE.compare(np.array(numbers), low, high, np.array(high) * 8))


def _table(count: int) -> Outcome:
    table = np.asarray(material_law.natural_table(count), np.float64)
    log, m_d, m_s = table[:, 0], table[:, 1:4], table[:, 4]
    steps = np.linspace(shininess.LOG_LOW, shininess.LOG_HIGH, count)
    slack = NUMPY_SINGLE.tolerance(1.0)
    return Outcome(
        joined(
            [
                NUMPY_SINGLE.compare(log, steps, steps, steps),
                Compared(m_d, 0.0, 1.0, 0.0),
                Compared(m_s, 0.0, 1.0, 0.0),
                Compared(m_d.max(1) + m_s, 0.0, 1.0, slack),
            ]
        )
    )
