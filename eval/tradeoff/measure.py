"""The measurement of the trade-off: time, memory and size of every variant, and its errors.

Every run is measured in every runtime and precision, with one image at a time on all threads. For
ONNX Runtime the batch, the threads and the requested part are also changed, one at a time. Each
case is timed in separate processes (`timing`). In each round every case is timed once, so that
other programs on the machine disturb all cases alike. Measurements are kept and reused while their
inputs are the same.
"""

import dataclasses
import datetime
import functools
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tqdm import tqdm

from lime_keras import console
from lime_keras.data.corpus import SPLITS, Split

from ..store import Store
from . import machine, recommendation, timing
from .cases import Bench, TimedCase, compares_runtimes, is_whole
from .fidelity import Fidelity
from .run_formats import PRECISIONS, Run
from .runtimes import ONNX
from .samples import Samples

ROUNDS = 3
EFFORT = timing.Effort()


def measure(
    runs: Mapping[str, Path],
    corpus: Path,
    store: Store,
    *,
    camera: bool = False,
) -> dict[str, Any]:
    """Measure the trade-off of trained runs; continue where an earlier call was stopped.

    Args:
        runs: runs of `lime-train`, by the names that the tables show.
        corpus: folder with complete `train` and `test` splits.
        store: store that keeps the measurements and the models in every format.
        camera: show photos of the scenes (`lime_keras.data.camera`) instead of clean images.

    Returns:
        As JSON: `machine`, `date`, `load` (average number of running processes at the start),
        `corpus`, `camera`, `count` of test images, `rounds`, `runs` (`costs` of
        each run), `scored` (the measures in the score), `rows`,
        `purposes` (what each run is for) and `recommendations`. A row holds the attributes of a
        `TimedCase`, the times of `timing.pooled`, `model_mib`, `parameters` and `gflop`. The row of
        a whole system also holds its `errors` with their `interval`, `chance` and `count`, the
        runtime that they were `measured_on`, the `difference` from Keras, the `score` and, in the
        full cross, whether it is on the `front`.

    Raises:
        FileNotFoundError: if a run holds no trained model, or the corpus lacks a split.
        ValueError: if there is no run, a name is not fit for a file, or a run's image size does not
            fit the corpus.
        RuntimeError: if a process that measures fails.
    """
    if not runs or any(name in ("", "..") or name != Path(name).name for name in runs):
        raise ValueError(f"runs {sorted(runs)}: pass at least one, each named as a file may be")
    for split in SPLITS:  # int8 is calibrated on the train split, which would be missed late
        Split(corpus, split).shard_paths()
    load = os.getloadavg()[0]
    samples = Samples(corpus, store, camera=camera)
    opened = {name: Run(name, path, samples, store) for name, path in runs.items()}
    answered = _answered(opened, store)
    rows = _timed(Bench(opened), store)
    scored = recommendation.scored(list(answered.values()))
    _judge(rows, answered, scored)
    alone = [row for row in rows if is_whole(row) and row["batch"] == 1]
    return {
        "machine": machine.describe(),
        "date": datetime.datetime.now().astimezone().isoformat(timespec="minutes"),
        "load": load,
        "corpus": str(corpus),
        "camera": camera,
        "count": alone[0]["count"],
        "rounds": ROUNDS,
        "runs": {name: {"costs": run.costs} for name, run in opened.items()},
        "scored": scored,
        "rows": rows,
        "purposes": recommendation.for_purposes(_plain(alone)),
        "recommendations": [recommendation.for_this_machine(alone, machine.cores())],
    }


def _plain(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows in float32 under ONNX Runtime on all threads."""
    plain = (ONNX, "float32", machine.cores())
    return [row for row in rows if (row["runtime"], row["precision"], row["threads"]) == plain]


def _judge(rows: list[dict[str, Any]], answered: Mapping, scored: list[str]) -> None:
    """Add errors and score to the rows of whole systems, and `front` to those of the full cross."""
    for row in filter(is_whole, rows):
        row |= answered[row["model"], row["runtime"], row["precision"]]
        row["score"] = recommendation.score(row, scored)
    crossed = [row for row in rows if compares_runtimes(row, machine.cores())]
    points = [(row["latency_ms"], row["score"]) for row in crossed]
    for row, on_front in zip(crossed, recommendation.front(points), strict=True):
        row["front"] = on_front


def _answered(runs: Mapping[str, Run], store: Store) -> dict[tuple[str, str, str], dict[str, Any]]:
    """Return the errors and the difference from Keras by run, runtime and precision."""
    variants = [
        (name, runtime, precision)
        for name in runs
        for runtime, precisions in PRECISIONS.items()
        for precision in precisions
    ]
    fidelities = {name: Fidelity(run, store) for name, run in runs.items()}
    answered = {}
    for name, runtime, precision in tqdm(variants, "answers", **console.bar_options()):
        of = fidelities[name]
        difference = max(of.difference(runtime, precision).values())
        errors = of.errors(runtime, precision)
        answered[name, runtime, precision] = {**errors, "difference": difference}
    return answered


def _timed(bench: Bench, store: Store) -> list[dict[str, Any]]:
    """Time all cases, and return a row for each case with its rounds pooled."""
    cases = bench.cases()
    jobs = {
        case: bench.job(case, EFFORT) for case in tqdm(cases, "models", **console.bar_options())
    }
    rounds: dict[TimedCase, list] = {case: [] for case in cases}
    turns = [(number, case) for number in range(1, ROUNDS + 1) for case in cases]
    for number, case in tqdm(turns, "times", **console.bar_options()):
        key = {**bench.depends_on(case, jobs[case]), "round": number}
        run = functools.partial(timing.measure, jobs[case])
        name = f"times/{case.name}-round{number}"
        rounds[case].append(store.value(name, key, run, code=bench.code(case)))
    return [
        {
            **dataclasses.asdict(case),
            **timing.pooled(measured, case.batch),
            **bench.costs(case, jobs[case]),
        }
        for case, measured in rounds.items()
    ]
