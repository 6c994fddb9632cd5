"""The recommendation of a variant: a score, the Pareto front, and the best of this machine."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

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
scores, so the cheaper variant is taken."""
FRAME_MS = 1000 / 30
"""Milliseconds for a frame of video at 30 frames per second."""

Row = Mapping[str, Any]


def scored(rows: Sequence[Row]) -> list[str]:
    """Return the measures of `SCORED` that all systems have, so that scores can be compared.

    A measure whose chance is 0, because all test images have the same truth, is left out.

    Args:
        rows: `errors` and `chance` of each system, by measure.
    """
    return [
        name
        for name in SCORED
        if all(name in row["errors"] and row["chance"][name] > 0 for row in rows)
    ]


def score(row: Row, names: Sequence[str]) -> float:
    """Return the mean of error ÷ chance over the named measures: 0 is perfect, 1 is chance.

    Args:
        row: `errors` and `chance` by measure; chance is that of `measures.summarise`, so it follows
            from the law of the materials.
        names: result of `scored`.

    Raises:
        ValueError: if no measure is named.
    """
    if not names:
        raise ValueError(f"the systems share none of {', '.join(SCORED)}: compare fewer of them")
    return sum(row["errors"][name] / row["chance"][name] for name in names) / len(names)


def front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Return for each point (cost, error) whether it is on the Pareto front.

    A point is on the front if no other point is at most as high in both and lower in one.

    Raises:
        ValueError: if a number is NaN or infinite.
    """
    if not all(math.isfinite(number) for point in points for number in point):
        raise ValueError("a cost or an error is not finite: measure that variant again")

    def beaten(point: tuple[float, float]) -> bool:
        cost, error = point
        return any(c <= cost and e <= error and (c, e) != point for c, e in points)

    return [not beaten(point) for point in points]


def for_purposes(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the models that are worth taking, the slowest first, with what each is for.

    A model is worth it if no other is both faster and as good. Models are compared as whole systems
    with one image at a time, in float32 under ONNX Runtime on all threads.

    Args:
        rows: the row of each model, with `model`, `latency_ms` and `score`.

    Returns:
        For each model that is worth it: `model`, `latency_ms` and `score`; and, under `beaten`, the
        names of the models that it makes superfluous.
    """
    on = front([(row["latency_ms"], row["score"]) for row in rows])
    worth = [
        {name: row[name] for name in ("model", "latency_ms", "score")} | {"beaten": []}
        for row, kept in zip(rows, on, strict=True)
        if kept
    ]
    worth.sort(key=lambda one: one["latency_ms"], reverse=True)
    for row, kept in zip(rows, on, strict=True):
        if not kept:
            beats = (
                one
                for one in worth
                if one["latency_ms"] <= row["latency_ms"] and one["score"] <= row["score"]
            )
            next(beats)["beaten"].append(row["model"])
    return worth


def for_this_machine(rows: Sequence[Row], cores: int) -> dict[str, Any]:
    """Return the variant with the least score that answers 30 images a second on this machine.

    Of equally good variants the fastest is taken; where none is fast enough, the fastest of all.

    Args:
        rows: rows of whole systems with one image at a time, with `threads`, `latency_ms` and
            `score`, all of them finite.
        cores: number of threads on all of this machine's cores; only these rows take part.

    Returns:
        `device`, `rule` in words, `budget` and its `unit`, the `row`, its `cost`, and `within`,
        whether it meets the budget.
    """
    chosen = [row for row in rows if row["threads"] == cores]
    within = [row for row in chosen if row["latency_ms"] <= FRAME_MS]
    least = min((row["score"] for row in within), default=math.inf)
    as_good = [row for row in within if row["score"] <= least * (1 + _AS_GOOD)]
    row = min(as_good or chosen, key=lambda one: one["latency_ms"])
    return {
        "device": "this machine",
        "rule": f"all {cores} threads of this machine within {FRAME_MS:.1f} ms",
        "budget": FRAME_MS,
        "unit": "ms",
        "row": dict(row),
        "cost": row["latency_ms"],
        "within": bool(within),
    }
