"""The measurement of the trade: time, memory and size of every case, and its errors.

Each case is timed in processes of its own (`timing`). In each round every case is timed once, so
that other programs on the machine disturb all cases alike. Every measurement is kept as soon as it
is made (`kept`), so that a command that was stopped goes on. Another list of models is timed anew:
times of different hours differ by themselves.
"""

import dataclasses
import datetime
import functools
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tqdm import tqdm

from lime_keras import console, machine, processors
from lime_keras.data.corpus import SPLITS, Split
from lime_keras.export.parity import ParityError
from lime_keras.io import untrusted
from lime_keras.live import server
from lime_keras.model import folder as model_folder
from lime_keras.runtime import engine as runtime

from .. import kept
from ..accuracy import measures
from ..accuracy.evaluate import evaluate
from . import cases, models, recommendation, timing
from .cases import ONNX, PAGE, PAPER, TimedUse

ROUNDS = 3
PICTURE = server.PAGE / "sample.jpg"  # the first photo that the live page offers


def measure(
    runs: Mapping[str, Path], corpus: Path, results: Path, folder: Path, *, camera: bool = False
) -> dict[str, Any]:
    """Measure the trade of trained runs; continue where an earlier call was stopped.

    Args:
        runs: folder of each trained model, by the name that the tables show.
        corpus: folder with complete `train` and `test` splits.
        results: folder of the measurements so far.
        folder: folder for the models in other precisions and as SavedModel.
        camera: show photos of the scenes (`lime_keras.data.camera`) instead of clean images.

    Returns:
        As JSON: `machine`, `date`, `timed` (when the first and the last case was timed, in UTC),
        `load` (average number of running processes at the start), `corpus`, `camera`, `count` of
        test images, `rounds`, `scored` (the measures in the score), `refused` (why a model has no
        rows in a precision), `rows`, and `advice` (`recommendation.advise`). A row has the
        attributes of a `TimedUse`, the times of `timing.pooled`, `model_mib`, and, but for
        `paper`, `errors`, `interval`, `chance` and `score`.

    Raises:
        FileNotFoundError: if a run holds no trained model, or the corpus lacks a split.
        ValueError: if there is no run, a name is not fit for a file, or a run's image size does not
            fit the corpus.
        RuntimeError: if a process that measures fails.
    """
    if not runs or any(name in ("", "..", PAPER) or name != Path(name).name for name in runs):
        raise ValueError(
            f"runs {sorted(runs)}: pass at least one, each named as a file may be, but not {PAPER}"
        )
    for split in SPLITS:  # int8 is calibrated on the train split, which would be missed late
        Split(corpus, split).shard_paths()
    load = os.getloadavg()[0]

    # Write the models in each precision and format.
    listed = [case for name in (*runs, PAPER) for case in cases.of_model(name, processors.count())]
    refused: dict[str, str] = {}
    paths: dict[TimedUse, Path] = {}
    for case in tqdm(listed, "models", **console.bar_options()):
        variant = f"{case.model} in {case.precision if case.kind != PAGE else 'a browser'}"
        try:
            if variant not in refused:
                paths[case] = models.path(case, runs, corpus, folder)
        except (ParityError, models.Unavailable) as error:
            refused[variant] = str(error)
            tqdm.write(f"warning: {variant} is left out: {error}", file=sys.stderr)

    # Measure their errors, then their times.
    variants = {
        (case.model, case.precision): path
        for case, path in paths.items()
        if case.model != PAPER and case.runtime == ONNX
    }
    errors = {
        (name, precision): _errors(runs[name], path, precision, corpus, results, camera=camera)
        for (name, precision), path in tqdm(variants.items(), "errors", **console.bar_options())
    }
    scored = recommendation.scored(list(errors.values()))
    rows, timed = _timed(paths, runs, results)
    for row in rows:
        if row["model"] != PAPER:
            run = runs[row["model"]]
            row["weights"] = run.name if run in model_folder.shipped().values() else str(run)
            row |= errors[row["model"], row["precision"]]
            row["score"] = recommendation.score(row, scored)
    return {
        "machine": machine.describe(),
        "date": datetime.datetime.now().astimezone().isoformat(timespec="minutes"),
        "timed": timed,
        "load": load,
        "corpus": str(corpus),
        "camera": camera,
        "count": next(iter(errors.values()))["count"],
        "rounds": ROUNDS,
        "scored": scored,
        "refused": refused,
        "rows": rows,
        "advice": recommendation.advise(rows),
    }


def _errors(
    run: Path, path: Path, precision: str, corpus: Path, results: Path, *, camera: bool
) -> dict[str, Any]:
    """Return `errors`, `interval` and `chance` by measure, and the `count` of images.

    SavedModel, Keras and the page have those of the graphs in float32, with which they agree to
    10⁻³.
    """

    def make() -> dict[str, Any]:
        engine = runtime.load(path, precision=precision)
        summary = measures.summarise(evaluate(run, corpus, camera=camera, engine=engine))
        known = [name for name in measures.MEASURES if name in summary]
        return {
            "errors": {name: summary[name] for name in known},
            "interval": {name: summary["interval"][name] for name in known},
            "chance": summary["chance"],
            "count": summary["count"],
        }

    of_what = {"weights": model_folder.digest(run), "code": kept.code()} | kept.corpus_of(corpus)
    inputs: dict[str, Any] = {**of_what, "camera": camera, "precision": precision}
    if precision == "int8":
        inputs["calibration"] = untrusted.sha256(Split(corpus, "train").manifest_path)
    return kept.value(results, "errors", inputs, make)


def _timed(
    paths: Mapping[TimedUse, Path], runs: Mapping[str, Path], results: Path
) -> tuple[list[dict[str, Any]], list[str]]:
    """Time all cases in turns; return a row for each, and when the first and last was timed."""
    about = machine.describe()
    of_what = {
        **timing.EFFORT,
        "weights": {name: model_folder.digest(run) for name, run in runs.items()},
        "machine": {name: about[name] for name in ("processor", "cores", "packages")},
    }
    rounds: dict[TimedUse, list[Any]] = {case: [] for case in paths}
    turns = [(number, case) for number in range(ROUNDS) for case in paths]
    for number, case in tqdm(turns, "times", unit="process", **console.bar_options()):
        inputs = {**dataclasses.asdict(case), **of_what, "round": number}
        make = functools.partial(_timed_once, case, paths[case])
        rounds[case].append(kept.value(results, f"times/{case.name}", inputs, make))
    rows = [
        {
            **dataclasses.asdict(case),
            **timing.pooled(measured),
            "model_mib": models.size(case, paths[case]) / 2**20,
        }
        for case, measured in rounds.items()
    ]
    ends = sorted(one["at"] for measured in rounds.values() for one in measured)
    return rows, [ends[0], ends[-1]]


def _timed_once(case: TimedUse, path: Path) -> dict[str, Any]:
    """Return a result of `timing.measure`, and when it was measured, as `at` in UTC."""
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="minutes")
    return timing.measure(case, path, PICTURE) | {"at": now}
