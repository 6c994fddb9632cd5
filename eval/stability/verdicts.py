"""Cases of the stability suite, their outcomes, and the verdicts on them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Verdict:
    """The verdict on one case: a row of the suite's table.

    The numbers are those of the worst element: the element with the largest error relative to its
    tolerance. `reference`, `error` and `tolerance` belong to the value, or to the gradient if its
    error is worse; `note` then says so.

    Attributes:
        part: name of the part of the library, such as "lobe".
        case: name of the extreme input.
        precision: name of the precision, such as "float16" or "XLA float32".
        value: result of the part; None if bad data was refused.
        gradient: derivative of the part, if training needs one.
        reference: correct result, in double precision or better.
        error: absolute distance from the reference; at a kink, from the nearest correct value.
        tolerance: largest error that the precision explains.
        passed: whether the error is within the tolerance, or bad data was refused.
        note: message of the refusal, or "error of the gradient".
    """

    part: str
    case: str
    precision: str
    value: float | None = None
    gradient: float | None = None
    reference: float | None = None
    error: float | None = None
    tolerance: float | None = None
    passed: bool = field(kw_only=True)
    note: str = ""


@dataclass(frozen=True)
class Compared:
    """Computed numbers with their references; the shapes broadcast together.

    Attributes:
        found: computed numbers.
        low: least correct values; equal to `high` except at a kink. NaN means that NaN is correct.
        high: greatest correct values; infinite where the precision may overflow.
        tolerance: largest accepted distances from the interval between `low` and `high`.
    """

    found: np.ndarray
    low: np.ndarray | float
    high: np.ndarray | float
    tolerance: np.ndarray | float

    def worst(self) -> tuple[float, float, float, float]:
        """Return the worst element as found value, nearest reference, distance and tolerance."""
        arrays = (np.asarray(a, np.float64) for a in (self.found, self.low, self.high))
        found, low, high, tolerance = np.broadcast_arrays(*arrays, self.tolerance)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            nearest = np.clip(found, low, high)
            nearest = np.where(np.isnan(found), low, nearest)
            distance = np.where(found == nearest, 0.0, np.abs(found - nearest))
            distance = np.where(np.isnan(found) & np.isnan(low), 0.0, distance)
            distance = np.where(np.isnan(distance), np.inf, distance)
            share = np.where(distance == 0, 0.0, distance / tolerance)
        # If all elements are exact, report the one with the largest reference.
        size = np.nan_to_num(np.abs(nearest), nan=0.0, posinf=0.0)
        index = np.lexsort((size.ravel(), np.nan_to_num(share, nan=np.inf).ravel()))[-1]
        return (
            float(found.ravel()[index]),
            float(nearest.ravel()[index]),
            float(distance.ravel()[index]),
            float(tolerance.ravel()[index]),
        )


def joined(parts: Iterable[Compared]) -> Compared:
    """Join several comparisons into one, with flat arrays `(N,)`."""
    rows = []
    for part in parts:
        arrays = np.broadcast_arrays(part.found, part.low, part.high, part.tolerance)
        rows.append(np.stack([array.ravel() for array in arrays]))
    return Compared(*np.concatenate(rows, axis=1))


@dataclass(frozen=True)
class Outcome:
    """The outcome of a case: numbers with references, or the message of a refusal."""

    value: Compared | None = None
    gradient: Compared | None = None
    note: str = ""


@dataclass(frozen=True)
class Case:
    """A part of the library, an extreme input, a precision, and the function that measures them."""

    part: str
    name: str
    precision: str
    measure: Callable[[], Outcome]

    @property
    def id(self) -> str:
        """The unique name of the case."""
        return f"{self.part}: {self.name} [{self.precision}]"

    def judge(self) -> Verdict:
        """Run the case and return its verdict; an exception is a verdict that failed."""
        about = self.part, self.name, self.precision
        try:
            outcome = self.measure()
        except Exception as error:
            note = f"{type(error).__name__}: {first_line(error)}"
            return Verdict(*about, passed=False, note=note)
        of_value, of_gradient = (
            compared.worst() if compared else None for compared in (outcome.value, outcome.gradient)
        )
        known = [numbers for numbers in (of_value, of_gradient) if numbers]
        if not known:
            return Verdict(*about, passed=True, note=outcome.note)
        # Of value and gradient, the worse is compared.
        worse = max(known, key=lambda numbers: _share(*numbers[2:]))
        note = outcome.note
        if of_value and worse is not of_value:
            note = "; ".join(filter(None, ["error of the gradient", note]))
        return Verdict(
            *about,
            of_value[0] if of_value else None,
            of_gradient[0] if of_gradient else None,
            *worse[1:],
            passed=_share(*worse[2:]) <= 1,
            note=note,
        )


def first_line(error: Exception) -> str:
    """Return the first line of an error's message."""
    return str(error).partition("\n")[0]


def _share(error: float, tolerance: float) -> float:
    """Return the error as a share of the tolerance."""
    if error == 0:
        return 0.0
    return error / tolerance if tolerance > 0 else np.inf
