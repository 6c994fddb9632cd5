"""Every numeric part of the library at its extremes: what it answers, what it should, a verdict.

Example:
    from lime_keras.eval.stability import suite

    print(suite.markdown(suite.run()))
"""

import dataclasses
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import keras
from tqdm import tqdm

from ..markdown_table import ABSENT, aligned
from .cases import (
    colour,
    compositing,
    environment,
    exponent,
    losses,
    metrics,
    networks,
    photos,
    records,
    reflectance,
    reflectance_map,
    shading,
)
from .trials.verdicts import Case, Verdict

KNOWN = {
    ("cross-entropy", exponent.BEYOND): (
        "the loss sees probabilities, not logits, and calls none smaller than 1e-7: where a wrong "
        "class leads by more than 16.1 nats it stays at 16.1 and teaches nothing"
    ),
    ("measures", f"relative error, {metrics.UNLIT}"): (
        "no error relative to nothing is finite; it counts as 0, or one such image would be the "
        "mean of all"
    ),
}
"""Parts and cases that are known to fail, in any precision, and why."""

HEADER = (
    "Case",
    "Precision",
    "Value",
    "Gradient",
    "Reference",
    "Error",
    "Tolerance",
    "Verdict",
    "Note",
)
_SUMMARY = ("Part", "Checks", "Passed", "Known", "Failed")


def cases(model_dir: Path | None = None) -> list[Case]:
    """Everything that is tried, in the order of the tables; nothing is computed yet.

    Args:
        model_dir: run of `lime-train`, or folder of `lime_keras.networks.weights.save`, whose
            networks and exported formats are tried; without one, those of small networks with
            fresh weights.
    """
    modules = (
        reflectance,
        shading,
        environment,
        reflectance_map,
        colour,
        compositing,
        losses,
        exponent,
        metrics,
        photos,
        records,
    )
    out = [case for module in modules for case in module.cases()]
    return out + networks.cases(model_dir)


def run(model_dir: Path | None = None, progress: bool = True) -> list[Verdict]:
    """Try everything; some half a minute with fresh weights, longer with a large trained model.

    Args:
        model_dir: as of `cases`.
        progress: whether to show a bar on standard error.

    Raises:
        FileNotFoundError: if `model_dir` holds no trained model.
        ValueError: if the model cannot be read, or Keras' backend is not TensorFlow, by which
            derivatives are taken here.
    """
    if keras.backend.backend() != "tensorflow":
        raise ValueError(
            f"Keras computes with {keras.backend.backend()}, but derivatives are taken by "
            "TensorFlow here: unset KERAS_BACKEND"
        )
    if model_dir is not None:
        # Else every case of the networks would fail for this one reason.
        networks.check(model_dir)
    tried = cases(model_dir)
    with tqdm(tried, desc="stability", unit="check", disable=not progress) as bar:
        return [_explained(case.judge()) for case in bar]


def is_known(verdict: Verdict) -> bool:
    """Whether the case is one of `KNOWN`."""
    return (verdict.part, verdict.case) in KNOWN


def failures(verdicts: Iterable[Verdict]) -> list[Verdict]:
    """What failed and is not known to."""
    return [verdict for verdict in verdicts if not verdict.passed and not is_known(verdict)]


def markdown(verdicts: Sequence[Verdict]) -> str:
    """Counts by part, then a table of each part, aligned so that it reads well in a terminal."""
    by_part: dict[str, list[Verdict]] = {}
    for verdict in verdicts:
        by_part.setdefault(verdict.part, []).append(verdict)
    counts = [(part, *_counted(rows)) for part, rows in by_part.items()]
    sections = [aligned([_SUMMARY, *counts, ("all", *_counted(verdicts))])]
    for part, rows in by_part.items():
        sections.append(f"### {part[0].upper()}{part[1:]}")
        sections.append(aligned([HEADER, *map(_cells, rows)], texts=(0, 1, 7, 8)))
    return "\n\n".join(sections) + "\n"


def to_json(verdicts: Iterable[Verdict]) -> list[dict[str, object]]:
    """Dictionaries for `json.dumps`; numbers that JSON lacks as "nan", "inf" and "-inf"."""
    return [
        {
            name: str(value) if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in dataclasses.asdict(verdict).items()
        }
        for verdict in verdicts
    ]


def _explained(verdict: Verdict) -> Verdict:
    """A failure that is known, with its reason."""
    if verdict.passed or not is_known(verdict):
        return verdict
    return dataclasses.replace(verdict, note=KNOWN[verdict.part, verdict.case])


def _state(verdict: Verdict) -> str:
    if verdict.passed:
        return "refused" if verdict.value is None and verdict.gradient is None else "passed"
    return "known" if is_known(verdict) else "FAILED"


def _counted(verdicts: Sequence[Verdict]) -> tuple[str, ...]:
    """How many there are, and how many passed (refusals among them), are known and failed."""
    states = Counter(map(_state, verdicts))
    passed = states["passed"] + states["refused"]
    return tuple(map(str, (len(verdicts), passed, states["known"], states["FAILED"])))


def _cells(verdict: Verdict) -> tuple[str, ...]:
    """The cells below `HEADER`."""
    numbers = (
        verdict.value,
        verdict.gradient,
        verdict.reference,
        verdict.error,
        verdict.tolerance,
    )
    written = [ABSENT if number is None else f"{number:.4g}" for number in numbers]
    return (verdict.case, verdict.precision, *written, _state(verdict), verdict.note)
