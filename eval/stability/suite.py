"""The stability suite: every numeric part at its extremes, compared with a reference.

Example:
    from lime_keras.eval.stability import suite

    print(suite.markdown(suite.run()))
"""

import dataclasses
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import keras
from tqdm import tqdm

from ..markdown_table import ABSENT, aligned
from .cases import (
    camera,
    colour,
    compositing,
    directions,
    environment,
    exponent,
    hue,
    layers,
    light_law,
    losses,
    materials,
    metrics,
    mixtures,
    networks,
    orthogonal,
    page,
    photos,
    records,
    reflectance,
    reflectance_map,
    runtime,
    shading,
)
from .trials.verdicts import Case, Verdict

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
_SUMMARY = ("Part", "Checks", "Passed", "Failed")


def cases(model_dir: Path | None = None) -> list[Case]:
    """Return all cases in the order of the tables, without computing anything.

    Args:
        model_dir: run of `lime-train`, or folder of `lime_keras.networks.weights.save`, with the
            networks to try in every precision and format; by default small networks with fresh
            weights.
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
        materials,
        light_law,
        mixtures,
        directions,
        layers,
        camera,
        hue,
        orthogonal,
        page,
    )
    out = [case for module in modules for case in module.cases()]
    # A model of the user's own is tried in the formats that `networks` has.
    return out + networks.cases(model_dir) + ([] if model_dir else runtime.cases())


def run(model_dir: Path | None = None, progress: bool = True) -> list[Verdict]:
    """Run all cases and return their verdicts.

    This takes about half a minute with fresh weights, and longer with a large trained model.

    Args:
        model_dir: folder of the networks to try (see `cases`).
        progress: whether to show a progress bar on standard error.

    Raises:
        FileNotFoundError: if `model_dir` holds no trained model.
        ValueError: if the model cannot be read, or if Keras' backend is not TensorFlow, which the
            suite needs for derivatives.
    """
    if keras.backend.backend() != "tensorflow":
        raise ValueError(
            f"Keras computes with {keras.backend.backend()}, but derivatives are taken by "
            "TensorFlow here: unset KERAS_BACKEND"
        )
    if model_dir is not None:
        # A missing model would make every case of the networks fail for the same reason.
        networks.check(model_dir)
    tried = cases(model_dir)
    with tqdm(tried, desc="stability", unit="check", disable=not progress) as bar:
        return [case.judge() for case in bar]


def failures(verdicts: Iterable[Verdict]) -> list[Verdict]:
    """Return the verdicts that failed."""
    return [verdict for verdict in verdicts if not verdict.passed]


def markdown(verdicts: Sequence[Verdict]) -> str:
    """Return the counts of each part and then a table of each part, in Markdown."""
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
    """Return dictionaries for `json.dumps`; non-finite numbers become "nan", "inf" and "-inf"."""
    return [
        {
            name: str(value) if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in dataclasses.asdict(verdict).items()
        }
        for verdict in verdicts
    ]


def _state(verdict: Verdict) -> str:
    if verdict.passed:
        return "refused" if verdict.value is None and verdict.gradient is None else "passed"
    return "FAILED"


def _counted(verdicts: Sequence[Verdict]) -> tuple[str, ...]:
    """Count all verdicts, those that passed (or were refused), and those that failed."""
    failed = len(failures(verdicts))
    return tuple(map(str, (len(verdicts), len(verdicts) - failed, failed)))


def _cells(verdict: Verdict) -> tuple[str, ...]:
    """Return the cells of a row in the order of `HEADER`."""
    numbers = (
        verdict.value,
        verdict.gradient,
        verdict.reference,
        verdict.error,
        verdict.tolerance,
    )
    written = [ABSENT if number is None else f"{number:.4g}" for number in numbers]
    return (verdict.case, verdict.precision, *written, _state(verdict), verdict.note)
