"""What became of a numeric part at one of its edges, beside what should have."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Verdict:
    """One row of the suite's table.

    Numbers are those of the element that comes nearest to its tolerance, or exceeds it most.
    `reference`, `error` and `tolerance` belong to the value, or, where the gradient is worse off
    (the note says so), to the gradient.

    Attributes:
        part: of the library, such as "lobe".
        case: the edge to which it was driven.
        precision: in which it was computed, such as "float16" or "XLA float32".
        value: what it answered; None where bad data was refused.
        gradient: its derivative, where training takes one.
        reference: what the answer should be, in double precision or more.
        error: absolute distance from the reference, or from the nearest of those that are right
            at a kink.
        tolerance: the largest error that the precision explains.
        passed: whether the error is within the tolerance, or bad data was refused.
        note: what was refused in which words, what the error is of, or why it is known.
    """

    part: str
    case: str
    precision: str
    value: float | None
    gradient: float | None
    reference: float | None
    error: float | None
    tolerance: float | None
    passed: bool
    note: str = ""

    @property
    def id(self) -> str:
        """The row's name, like `Case.id`."""
        return _id(self.part, self.case, self.precision)


@dataclass(frozen=True)
class Compared:
    """Numbers of any shape beside their references; all broadcast together.

    Attributes:
        found: what was computed.
        low: what it should be, or the least that is right at a kink. NaN demands NaN.
        high: the most that is right; infinite where the precision may overflow.
        tolerance: largest accepted distance from between the two.
    """

    found: np.ndarray
    low: np.ndarray | float
    high: np.ndarray | float
    tolerance: np.ndarray | float

    def worst(self) -> tuple[float, float, float, float]:
        """The worst element: found, the nearest reference, the distance, the tolerance."""
        arrays = (np.asarray(a, np.float64) for a in (self.found, self.low, self.high))
        found, low, high, tolerance = np.broadcast_arrays(*arrays, self.tolerance)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            nearest = np.clip(found, low, high)
            nearest = np.where(np.isnan(found), low, nearest)
            distance = np.where(found == nearest, 0.0, np.abs(found - nearest))
            distance = np.where(np.isnan(found) & np.isnan(low), 0.0, distance)
            distance = np.where(np.isnan(distance), np.inf, distance)
            share = np.where(distance == 0, 0.0, distance / tolerance)
        # Of elements that are all exact, the largest says most.
        size = np.nan_to_num(np.abs(nearest), nan=0.0, posinf=0.0)
        index = np.lexsort((size.ravel(), np.nan_to_num(share, nan=np.inf).ravel()))[-1]
        return (
            float(found.ravel()[index]),
            float(nearest.ravel()[index]),
            float(distance.ravel()[index]),
            float(tolerance.ravel()[index]),
        )


def joined(parts: Iterable[Compared]) -> Compared:
    """All the numbers of several, in one row."""
    rows = []
    for part in parts:
        arrays = np.broadcast_arrays(part.found, part.low, part.high, part.tolerance)
        rows.append(np.stack([array.ravel() for array in arrays]))
    return Compared(*np.concatenate(rows, axis=1))


@dataclass(frozen=True)
class Outcome:
    """What a case measured: numbers to compare, or the words of a refusal."""

    value: Compared | None = None
    gradient: Compared | None = None
    note: str = ""


@dataclass(frozen=True)
class Case:
    """A part at an edge in a precision, and how to measure it."""

    part: str
    name: str
    precision: str
    measure: Callable[[], Outcome]

    @property
    def id(self) -> str:
        """The case's name; no other has it."""
        return _id(self.part, self.name, self.precision)

    def judge(self) -> Verdict:
        """Measure, and compare; what the part raises is a verdict too."""
        try:
            outcome = self.measure()
        except Exception as error:
            note = f"{type(error).__name__}: {first_line(error)}"
            return self._verdict(passed=False, note=note)
        if outcome.value is None and outcome.gradient is None:
            return self._verdict(passed=True, note=outcome.note)
        return self._compared(outcome)

    def _compared(self, outcome: Outcome) -> Verdict:
        """The verdict on numbers: found, nearest, error and tolerance of each, the worse told."""
        of_value, of_gradient = (
            compared.worst() if compared else None for compared in (outcome.value, outcome.gradient)
        )
        known = [numbers for numbers in (of_value, of_gradient) if numbers]
        worse = max(known, key=lambda numbers: _share(*numbers[2:]))
        note = outcome.note
        if of_value and worse is not of_value:
            note = "; ".join(filter(None, ["error of the gradient", note]))
        return self._verdict(
            value=of_value[0] if of_value else None,
            gradient=of_gradient[0] if of_gradient else None,
            compared=worse[1:],
            passed=_share(*worse[2:]) <= 1,
            note=note,
        )

    def _verdict(
        self,
        *,
        passed: bool,
        note: str,
        value: float | None = None,
        gradient: float | None = None,
        compared: tuple[float | None, float | None, float | None] = (None, None, None),
    ) -> Verdict:
        reference, error, tolerance = compared
        return Verdict(
            part=self.part,
            case=self.name,
            precision=self.precision,
            value=value,
            gradient=gradient,
            reference=reference,
            error=error,
            tolerance=tolerance,
            passed=passed,
            note=note,
        )


class UnrefusedError(Exception):
    """Bad data that was taken."""


def refusal(action: Callable[[], object], *words: str) -> Outcome:
    """Hand bad data to `action`, which must refuse it by a `ValueError` with these words.

    Raises:
        UnrefusedError: if it takes the data, or refuses them in other words.
    """
    try:
        answer = action()
    except ValueError as error:
        if missing := [word for word in words if word not in str(error)]:
            raise UnrefusedError(f"refused without saying {missing}: {error}") from error
        return Outcome(note=f"refused: {first_line(error)}")
    raise UnrefusedError(f"taken, and answered with a {type(answer).__name__}")


def first_line(error: Exception) -> str:
    """The first line of an error's message."""
    return str(error).partition("\n")[0]


def _share(error: float, tolerance: float) -> float:
    """Of the tolerance, how much is used up."""
    if error == 0:
        return 0.0
    return error / tolerance if tolerance > 0 else np.inf


def _id(part: str, case: str, precision: str) -> str:
    return f"{part}: {case} [{precision}]"
