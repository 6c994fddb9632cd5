"""Cases for functions of one number, compared at chosen points with their formula in mpmath."""

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mpmath
import numpy as np

from lime_keras.eval.stability.verdicts import Case, Compared, Outcome

from .precisions import Precision

_DIGITS = 100
_TILES = 35  # elements: vectorised loops compute the first in blocks and the last singly


def cases(
    part: str,
    curve: Callable[[Any], Any],
    exact: Callable[[Any], Any],
    points: Mapping[str, float],
    precisions: Sequence[Precision],
) -> list[Case]:
    """Return a case for each point and each precision that can represent the point.

    Args:
        part: name of the part of the library.
        curve: elementwise function of an array or tensor.
        exact: the same function for an `mpmath` number.
        points: numbers by name; at NaN and infinity only the value is compared, not the gradient.
        precisions: precisions to try.
    """
    return [
        Case(part, name, precision.name, functools.partial(_measure, curve, exact, x, precision))
        for name, x in points.items()
        for precision in precisions
        if precision.holds(x)
    ]


def _measure(curve: Any, exact: Any, x: float, precision: Precision) -> Outcome:
    x = float(precision.rounded(x))
    value, gradients = precision.evaluate(curve, np.full(_TILES, x))
    if np.isnan(x):
        return Outcome(Compared(value, np.nan, np.nan, 0.0))
    if np.isinf(x):
        limit = float(exact(mpmath.mpf(x)))
        return Outcome(precision.compare(value, limit, limit, limit))
    right, slopes, curvature = reference(exact, x, precision.epsilon)
    steepest = max(map(abs, slopes))
    compared = precision.compare(value, right, right, abs(right) + abs(x) * steepest)
    if not gradients:
        return Outcome(compared)
    magnitude = steepest + abs(x) * curvature
    return Outcome(compared, precision.compare(gradients[0], min(slopes), max(slopes), magnitude))


@functools.cache
def reference(
    exact: Callable[[Any], Any], x: float, epsilon: float
) -> tuple[float, tuple[float, ...], float]:
    """Return the value, three slopes and the curvature of a function at a number.

    The slopes are taken two units in the last place below `x`, at `x`, and two units above. Any
    correct derivative lies between them, on a smooth curve as well as at a kink.
    """
    with mpmath.workdps(_DIGITS):
        at = mpmath.mpf(x)
        aside = 2 * epsilon * abs(at) or mpmath.mpf("1e-30")
        step = aside * mpmath.mpf("1e-15")

        def slope(point: Any) -> Any:
            return (exact(point + step) - exact(point - step)) / (2 * step)

        slopes = [slope(at + k * aside) for k in (-3, -1, 0, 1, 3)]
        curvature = max(abs(slopes[1] - slopes[0]), abs(slopes[4] - slopes[3])) / (2 * aside)
        return float(exact(at)), tuple(map(float, slopes[1:4])), float(curvature)
