"""Cases for the specular lobe of Eq. 3 and its normaliser, compared with mpmath."""

import functools
import math
from typing import Any

import mpmath
import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import shading

from .. import curves
from ..lights import EXPONENTS
from ..precisions import ARRAYS, NUMPY_SINGLE, ROUNDINGS, TENSORS, Precision

_LARGE = {"65504": 65504.0, "infinity": np.inf}

_UP = (0.0, 0.0, 1.0)
_DOWN = (0.0, 0.0, -1.0)
_SIDE = (1.0, 0.0, 0.0)
_SLANT = (math.sin(0.6), 0.0, math.cos(0.6))
_TILT = (0.48, 0.6, 0.64)
# Normal, direction to the viewer, direction to the light.
_GEOMETRIES = {
    # With i = o, the half vector h equals both, so h·n is their cosine to the normal.
    "cos = 1": (_UP, _UP, _UP),
    "cos = -1": (_DOWN, _UP, _UP),
    "cos = -0": ((1.0, 0.0, -0.0), _UP, _UP),
    "cos = 1e-38": ((1.0, 0.0, 1e-38), _UP, _UP),
    "cos = 1e-3": ((1.0, 0.0, 1e-3), _UP, _UP),
    "cos = 0.83": (_SLANT, _UP, _UP),
    "light opposite to the viewer": (_UP, _SLANT, tuple(-x for x in _SLANT)),
    "light opposite to the viewer, both level": (_UP, _SIDE, (-1.0, 0.0, 0.0)),
    "light level": (_UP, _UP, _SIDE),
    "viewer level": (_UP, _SIDE, _UP),
    "light just above the horizon": (_UP, _SLANT, (-1.0, 0.0, 1e-4)),
    "light just below the horizon": (_UP, _SLANT, (-1.0, 0.0, -1e-4)),
    "light nearly opposite to the viewer": (_UP, (1.0, 0.0, 1e-3), (-1.0, 0.0, 1e-3)),
    "light along the mirror direction": (_UP, _SLANT, (-_SLANT[0], 0.0, _SLANT[2])),
    "no axis": (_TILT, _SLANT, (-0.6, 0.64, 0.48)),
}


def cases() -> list[Case]:
    """Return the cases of the normaliser and of the lobe."""
    out = curves.cases(
        "normaliser",
        lambda s: shading.normaliser(s),
        _normaliser,
        {f"s = {name}": s for name, s in (EXPONENTS | _LARGE).items()},
        (*TENSORS, NUMPY_SINGLE),
    )
    for geometry in _GEOMETRIES:
        for exponent in EXPONENTS:
            for precision in ARRAYS:
                measure = functools.partial(_lobe, geometry, exponent, precision)
                out.append(Case("lobe", f"s = {exponent}, {geometry}", precision.name, measure))
    return out


def _normaliser(exponent: Any) -> Any:
    """Return the normaliser c(s) as printed in `docs/explanation/scene-model.md`."""
    if mpmath.isinf(exponent):
        return exponent
    return (exponent + 2) / (8 * mpmath.pi * (1 - mpmath.mpf(2) ** (-(exponent + 2) / 2)))


def _lobe(geometry: str, exponent: str, precision: Precision) -> Outcome:
    """Try the lobe c(s) (h·n)^s for one light of energy 1."""
    vectors = [np.array([vector]) for vector in _GEOMETRIES[geometry]]
    vectors = [vector / np.linalg.norm(vector) for vector in vectors]
    s = EXPONENTS[exponent]

    def lit(normal: np.ndarray, view: np.ndarray, light: np.ndarray) -> np.ndarray:
        return shading.specular(normal, view, s, light, np.ones(1, light.dtype))

    found, _ = precision.evaluate(lit, *vectors)
    normal, view, light = (precision.rounded(vector)[0] for vector in vectors)
    right, magnitude = _exact_lobe(normal, view, light, s, precision)
    return Outcome(Compared(found, right, right, precision.tolerance(magnitude)))


def _exact_lobe(
    normal: np.ndarray, view: np.ndarray, light: np.ndarray, s: float, precision: Precision
) -> tuple[float, float]:
    """Return the exact lobe, and its magnitude times its condition number.

    h·n is (i·n + o·n) / |i + o|. Rounding changes the dividend, and the divisor's square 2 + 2 i·o,
    by about ε times the terms that are added. The power multiplies a relative error by s; rounding
    s adds a relative error of s ln h·n. The error of a cosine's power is 1 at most.
    """
    with mpmath.workdps(50):
        n, o, i = ([mpmath.mpf(float(x)) for x in vector] for vector in (normal, view, light))
        half = [a + b for a, b in zip(i, o, strict=True)]
        length = mpmath.sqrt(_dot(half, half))
        dividend = _dot(half, n)
        if _dot(i, n) <= 0 or dividend <= 0 or length == 0:
            return 0.0, 0.0
        cosine = min(dividend / length, mpmath.mpf(1))
        lobe = cosine**s
        added = _size(i, n) + _size(o, n)
        condition = added / dividend + (1 + _size(i, o)) / length**2 - mpmath.log(cosine)
        moved = mpmath.expm1(s * condition * precision.epsilon) / precision.epsilon
        magnitude = min(lobe * (1 + moved), 1 / mpmath.mpf(ROUNDINGS * precision.epsilon))
        constant = _normaliser(mpmath.mpf(s))
        return float(constant * lobe), float(constant * magnitude)


def _size(a: list[Any], b: list[Any]) -> Any:
    """Return the sum of the absolute terms of a dot product."""
    return sum(abs(x * y) for x, y in zip(a, b, strict=True))


def _dot(a: list[Any], b: list[Any]) -> Any:
    return sum(x * y for x, y in zip(a, b, strict=True))
