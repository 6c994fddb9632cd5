"""Users trade speed for accuracy: time, memory and size of every variant against its errors.

Every run in every runtime and precision, one image at a time on all threads; around ONNX Runtime
the batch, the threads and the asked-for part change one at a time. Each time is taken in processes
of its own (`timing`), in rounds in which every case has its turn, so that a noisy neighbour hits
all alike. What was measured is kept, and not measured again while what it follows from is the same.
"""

import dataclasses
import datetime
import functools
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tqdm import tqdm

from ..store import Store
from . import machine, recommendation, timing
from .cases import Bench, Case, is_crossed, is_whole
from .fidelity import Fidelity
from .run_formats import INT8, PRECISIONS, Run
from .samples import Samples

ROUNDS = 3
EFFORT = timing.Effort()


def measure(
    runs: Mapping[str, Path],
    corpus: Path,
    store: Store,
    *,
    camera: bool = False,
    progress: bool = True,
) -> dict[str, Any]:
    """Measure the trade of some trained runs, or take up where an earlier call was stopped.

    Args:
        runs: runs of `lime-train` by the names that the tables are to give them.
        corpus: folder with complete `train` and `test` splits.
        store: for what is measured, and the models in every format.
        camera: show photos of the scenes (`lime_keras.data.camera`) instead of clean images.
        progress: tell of it on standard error.

    Returns:
        As JSON: `machine`, `date`, `load` (processes at work as it began), `corpus`, `camera`,
        `count` of test images, `rounds`, `runs` (`costs`, `int8_harm`, `best_ranges` and
        `best_int8` of each), `scored` (the measures in a score), `rows` and `recommendations`. A
        row is a `Case`, its times as `timing.pooled` has them, `model_mib`, `parameters` and
        `gflop`; of a whole system also the `errors` with their `interval`, the runtime that they
        were `measured_on`, the `difference` from Keras, the `score` and, in the full cross,
        whether it is on the `front`.

    Raises:
        FileNotFoundError: if a run holds no trained model, or the corpus lacks a split.
        ValueError: if there is no run, a name is no file's name, or a run and the corpus do not go
            together.
        RuntimeError: if a process that measures fails.
    """
    if not runs or any(name in ("", "..") or name != Path(name).name for name in runs):
        raise ValueError(f"runs {sorted(runs)}: pass at least one, each named as a file may be")
    load = os.getloadavg()[0]
    samples = Samples(corpus, store, camera=camera)
    opened = {name: Run(name, path, samples, store) for name, path in runs.items()}
    answered = _answered(opened, store, progress)
    rows = _timed(Bench(opened, store), store, progress)
    scored = recommendation.scored([one["errors"] for one in answered.values()])
    _judge(rows, answered, scored)
    alone = [row for row in rows if is_whole(row) and row["batch"] == 1]
    best_int8 = {name: run.best_int8 for name, run in opened.items()}
    return {
        "machine": machine.describe(),
        "date": datetime.datetime.now().astimezone().isoformat(timespec="minutes"),
        "load": load,
        "corpus": str(corpus),
        "camera": camera,
        "count": alone[0]["count"],
        "rounds": ROUNDS,
        "runs": {
            name: {
                "costs": run.costs,
                "int8_harm": run.int8_harm,
                "best_ranges": {precision: run.best_ranges(precision) for precision in INT8},
                "best_int8": run.best_int8,
            }
            for name, run in opened.items()
        },
        "scored": scored,
        "rows": rows,
        "recommendations": recommendation.for_devices(alone, machine.cores(), best_int8),
    }


def _judge(rows: list[dict[str, Any]], answered: Mapping, scored: list[str]) -> None:
    """Give whole systems' rows their errors and score, and those of the cross their front."""
    for row in filter(is_whole, rows):
        row |= answered[row["model"], row["runtime"], row["precision"]]
        row["score"] = recommendation.score(row["errors"], scored)
    crossed = [row for row in rows if is_crossed(row, machine.cores())]
    points = [(row["latency_ms"], row["score"]) for row in crossed]
    for row, on_front in zip(crossed, recommendation.front(points), strict=True):
        row["front"] = on_front


def _answered(
    runs: Mapping[str, Run], store: Store, progress: bool
) -> dict[tuple[str, str, str], dict[str, Any]]:
    """Errors and difference from Keras, by run, runtime and precision."""
    variants = [
        (name, runtime, precision)
        for name in runs
        for runtime, precisions in PRECISIONS.items()
        for precision in precisions
    ]
    fidelities = {name: Fidelity(run, store) for name, run in runs.items()}
    answered = {}
    for name, runtime, precision in tqdm(variants, "answers", disable=not progress):
        of = fidelities[name]
        difference = max(of.difference(runtime, precision).values())
        errors = of.errors(runtime, precision)
        answered[name, runtime, precision] = {**errors, "difference": difference}
    return answered


def _timed(bench: Bench, store: Store, progress: bool) -> list[dict[str, Any]]:
    """A row for each case, its rounds pooled."""
    cases = bench.cases()
    jobs = {case: bench.job(case, EFFORT) for case in tqdm(cases, "models", disable=not progress)}
    rounds: dict[Case, list] = {case: [] for case in cases}
    turns = [(number, case) for number in range(1, ROUNDS + 1) for case in cases]
    for number, case in tqdm(turns, "times", disable=not progress):
        key = {**bench.depends_on(case, EFFORT), "round": number}
        run = functools.partial(timing.measure, jobs[case])
        rounds[case].append(store.value(f"times/{case.name}-round{number}", key, run))
    return [
        {
            **dataclasses.asdict(case),
            **timing.pooled(measured, case.batch),
            **bench.costs(case, jobs[case]),
        }
        for case, measured in rounds.items()
    ]
