"""What to take: one error for each variant, the Pareto front, and the best within a budget."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..accuracy.measures import MEASURES
from .runtimes import ONNX

SCORED = {
    name: chance
    for name in (
        "log_exponent_mae",
        "diffuse_albedo_mae",
        "specular_albedo_mae",
        "specular_shading_relative",
        "mirror_relative",
    )
    if isinstance(chance := MEASURES[name].chance, float)
}
"""The measures that `score` averages, one for each thing that is estimated, the mask apart; and
what an answer that knows nothing reaches."""
_AS_GOOD = 0.01
"""Scores this much (relative) above the least count as equal to it: the test images cannot tell
them apart, and the cheaper one is taken."""
FRAME_MS = 1000 / 30
"""Milliseconds for a frame of video."""
PHONE_SLOWER = 5
"""How many times slower a phone's core is taken to be than this machine's. A server's core does up
to 64 float32 operations a cycle (two units of 512 bits), a middling phone's 16 (two of 128), at
clocks that are alike: 4, and a little for the memory. An assumption, to be replaced by a phone."""
GPU_GFLOP = 100.0
"""Arithmetic of a frame: 30 a second at 3 TFLOP/s, a quarter of the peak of the paper's Titan Xp,
which all GPUs made for computing since have."""

Row = Mapping[str, Any]


def scored(errors: Sequence[Mapping[str, float]]) -> list[str]:
    """Those of `SCORED` that every one of the systems answers, so that scores can be compared."""
    return [name for name in SCORED if all(name in one for one in errors)]


def score(errors: Mapping[str, float], names: Sequence[str]) -> float:
    """Mean over the named measures of error ÷ chance: 0 is perfect, 1 knows nothing.

    Raises:
        ValueError: if no measure is named.
    """
    if not names:
        raise ValueError(f"the systems share none of {', '.join(SCORED)}: compare fewer of them")
    return sum(errors[name] / SCORED[name] for name in names) / len(names)


def front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """Which of the points (cost, error) no other one beats: no worse in both, better in one.

    Raises:
        ValueError: if a number is NaN or infinite.
    """
    if not all(math.isfinite(number) for point in points for number in point):
        raise ValueError("a cost or an error is not finite: measure that variant again")

    def beaten(point: tuple[float, float]) -> bool:
        cost, error = point
        return any(c <= cost and e <= error and (c, e) != point for c, e in points)

    return [not beaten(point) for point in points]


def best(rows: Sequence[Row], cost: Callable[[Row], float], budget: float) -> dict[str, Any]:
    """The least score within a budget; the cheapest of those that are as good.

    Args:
        rows: variants with a `score`; at least one.
        cost: of a row.
        budget: largest cost accepted, in the same unit.

    Returns:
        `row`, its `cost`, and `within`, whether the budget is met: where no row meets it, `row` is
        the cheapest of all.
    """
    front([(cost(row), row["score"]) for row in rows])
    within = [row for row in rows if cost(row) <= budget]
    if not within:
        cheapest = min(rows, key=cost)
        return {"row": dict(cheapest), "cost": cost(cheapest), "within": False}
    least = min(row["score"] for row in within)
    as_good = [row for row in within if row["score"] <= least * (1 + _AS_GOOD)]
    chosen = min(as_good, key=cost)
    return {"row": dict(chosen), "cost": cost(chosen), "within": True}


def for_devices(rows: Sequence[Row], cores: int, best_int8: Mapping[str, str]) -> list[dict]:
    """What to take for a phone-class processor, for this machine and for a GPU.

    Args:
        rows: whole systems, one image at a time, with `model`, `runtime`, `precision`, `threads`,
            `latency_ms`, `gflop` and `score`.
        cores: threads that are all of this machine's.
        best_int8: of each model, the eight-bit precision that validation images chose; the other
            one is not recommended, however well it does on the test images.

    Returns:
        For each device `device`, `rule` in words, `budget` and its `unit`, and what `best` says.
    """
    chosen = [
        row
        for row in rows
        if not row["precision"].startswith("int8") or row["precision"] == best_int8[row["model"]]
    ]
    onnx = [row for row in chosen if row["runtime"] == ONNX]
    one_thread = [row for row in onnx if row["threads"] == 1]
    all_threads = [row for row in chosen if row["threads"] == cores]
    plain = [row for row in onnx if row["precision"] == "float32" and row["threads"] == cores]
    return [
        {
            "device": "a phone-class CPU",
            "rule": f"ONNX Runtime on one thread of this machine, times {PHONE_SLOWER} (assumed, "
            f"not measured), within {FRAME_MS:.1f} ms",
            "budget": FRAME_MS,
            "unit": "ms",
            **best(one_thread, lambda row: PHONE_SLOWER * row["latency_ms"], FRAME_MS),
        },
        {
            "device": "this laptop",
            "rule": f"all {cores} threads of this machine within {FRAME_MS:.1f} ms",
            "budget": FRAME_MS,
            "unit": "ms",
            **best(all_threads, lambda row: row["latency_ms"], FRAME_MS),
        },
        {
            "device": "a GPU",
            "rule": f"not measured here: by arithmetic, within {GPU_GFLOP:.0f} GFLOP an image",
            "budget": GPU_GFLOP,
            "unit": "GFLOP",
            **best(plain, lambda row: row["gflop"], GPU_GFLOP),
        },
    ]
