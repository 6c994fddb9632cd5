"""What the trade advises: a score, the Pareto front, and for each use the command to type."""

import math
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from .cases import ONNX, PAPER, PHOTO, STREAM

SCORED = (
    "log_exponent_mae",
    "diffuse_albedo_mae",
    "specular_albedo_mae",
    "specular_shading_relative",
    "mirror_relative",
)
"""The measures that `score` averages: one for each estimated quantity except the mask."""
_AS_GOOD = 0.01
"""Relative difference of scores that counts as equal: the test images cannot distinguish such
scores, so the faster case is taken."""
_WRITTEN_FIRST = 1.1
"""Factor for the time of graphs in fewer bits, which a user has to write: they have to be faster by
more than two measurements differ by."""
FRAME_MS = 1000 / 30  # milliseconds for a frame of video at 30 frames per second

Row = Mapping[str, Any]


def scored(rows: Sequence[Row]) -> list[str]:
    """Return the measures of `SCORED` that all models have, so that scores can be compared.

    A measure whose chance is 0, because all test images have the same truth, is left out.
    """
    return [
        name
        for name in SCORED
        if all(name in row["errors"] and row["chance"][name] > 0 for row in rows)
    ]


def score(row: Row, names: Sequence[str]) -> float:
    """Return the mean of error ÷ chance over the named measures: 0 is perfect, 1 is chance.

    Args:
        row: `errors` and `chance` by measure.
        names: at least one measure that `scored` returned.

    Raises:
        ValueError: if no measure is named.
    """
    if not names:
        raise ValueError("the models share no error with a chance above 0: compare fewer of them")
    return sum(row["errors"][name] / row["chance"][name] for name in names) / len(names)


def front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the points of time and error that no other beats, by rising time.

    Raises:
        ValueError: if a number is NaN or infinite.
    """
    if not all(math.isfinite(number) for point in points for number in point):
        raise ValueError("a time or an error is not finite: measure that case again")
    best: list[tuple[float, float]] = []
    for point in sorted(points):
        if not best or point[1] < best[-1][1]:
            best.append(point)
    return best


def advise(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return for each use the row with the least score that is fast enough, and its command.

    Of equally good rows the fastest is taken; where none is fast enough, the fastest of all. A row
    in fewer bits has to be faster than one in float32 by a tenth.

    Args:
        rows: rows with the attributes of a `TimedUse`, `ms` and `score`.

    Returns:
        For a photo, a camera at 30 frames a second, and the same with the light: the `use`, its
        `budget_ms` (None without one), the `row`, `within` (whether it meets the budget), and the
        `commands` to type.
    """
    uses = {
        "a photo": (PHOTO, "everything", None),
        "a camera, 30 frames a second": (STREAM, "material", FRAME_MS),
        "a camera with the light": (STREAM, "with the light", 2 * FRAME_MS),
    }
    known = [row for row in rows if row["model"] != PAPER and row["runtime"] == ONNX]
    most = max(row["threads"] for row in known)
    out = []
    for use, (kind, asked, budget) in uses.items():
        chosen = [
            row
            for row in known
            if (row["kind"], row["asked"], row["threads"]) == (kind, asked, most)
        ]
        within = [row for row in chosen if budget is None or row["ms"] <= budget]
        least = min((row["score"] for row in within), default=math.inf)
        as_good = [row for row in within if row["score"] <= least * (1 + _AS_GOOD)]
        factor = {"float32": 1.0}
        row = min(
            as_good or chosen, key=lambda r: r["ms"] * factor.get(r["precision"], _WRITTEN_FIRST)
        )
        advice = {"use": use, "budget_ms": budget, "row": dict(row), "within": bool(within)}
        out.append(advice | {"commands": commands(row)})
    return out


def commands(row: Row) -> list[str]:
    """Return what a user types to run a row, with what has to be written before."""
    weights = shlex.quote(row["weights"])
    command, model = ("lime-live", "") if row["kind"] == STREAM else ("lime-estimate", " PHOTO")
    if row["precision"] == "float32":
        return [f"{command}{model} --weights {weights}"]
    name = shlex.quote(f"{row['model']}-{row['precision']}")
    precision = f"--precision {row['precision']}"
    calibrated = " --corpus CORPUS" if row["precision"] == "int8" else ""
    return [
        f"lime-export {name} --format graphs {precision} --weights {weights}{calibrated}",
        f"{command}{model} --weights {name} {precision}",
    ]
