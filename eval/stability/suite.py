"""The stability suite of a trained system, at its extremes, compared with a reference.

Example:
    from lime_keras.eval.stability import suite

    print(suite.markdown(suite.run(suite.cases(Path("runs/mine")))))
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import keras
from tqdm import tqdm

from lime_keras import console
from lime_keras.model import weights

from ..markdown_table import ABSENT, aligned
from .precisions import EXPORTED, TENSORS, Precision
from .systems import BATCH, TrialSystem, extreme_photos
from .verdicts import Case, Compared, Outcome, Verdict, joined

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
_SQUARABLE = 1e15
"""Largest derivative accepted, so that the optimiser can square it in single precision."""


def cases(model_dir: Path) -> list[Case]:
    """Return all cases in the order of the tables, without computing anything.

    Args:
        model_dir: run of `lime-train`, or folder of `lime_keras.model.weights.save`, with the
            networks to try in every precision and format.

    Raises:
        FileNotFoundError: if `model_dir` holds no trained model.
        ValueError: if the model cannot be read.
    """
    # A missing model would make every case fail for the same reason.
    weights.load(model_dir)
    return cases_of("trained system", TrialSystem(model_dir))


def cases_of(
    part: str, system: TrialSystem, precisions: Sequence[Precision] = (*TENSORS, *EXPORTED)
) -> list[Case]:
    """Return the cases of a system: images, batches and derivatives in each precision.

    Outputs are compared with `double_precision`. Its random rounding errors of each precision
    determine the tolerance. The system's name in the tables is `part`.
    """
    out = []

    def add(name: str, precision: Precision, measure: Callable[..., Outcome], *more: Any) -> None:
        measure = functools.partial(measure, system, *more)
        out.append(Case(part, name, precision.name, measure))

    for precision in precisions:
        for image in extreme_photos(2):
            add(image, precision, _alone, precision, image)
        in_a_batch = f"all images, in a batch of {BATCH} that ends in NaN"
        add(in_a_batch, precision, _in_a_batch, precision)
        if not precision.compiled:
            add("derivatives by the weights, all images", precision, _derivatives, precision)
    return out


def run(cases: Sequence[Case]) -> list[Verdict]:
    """Run cases and return their verdicts.

    A small system takes seconds, and a large one minutes.

    Raises:
        ValueError: if Keras' backend is not TensorFlow, which takes the derivatives.
    """
    if keras.backend.backend() != "tensorflow":
        raise ValueError(
            f"Keras computes with {keras.backend.backend()}, but derivatives are taken by "
            "TensorFlow here: unset KERAS_BACKEND"
        )
    return [
        case.judge()
        for case in tqdm(cases, desc="stability", unit="check", **console.bar_options())
    ]


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


def _alone(system: TrialSystem, precision: Precision, image: str) -> Outcome:
    """Try an image in a batch of one."""
    found = system.answers(precision, system.images[image][None])
    return Outcome(system.compared(image, found, precision.epsilon))


def _derivatives(system: TrialSystem, precision: Precision) -> Outcome:
    """Try the derivatives by the weights: the optimiser must be able to square them."""
    steepest = system.steepest(precision)
    return Outcome(gradient=Compared(steepest, 0.0, _SQUARABLE, 0.0))


def _in_a_batch(system: TrialSystem, precision: Precision) -> Outcome:
    """Try all images in one batch: position and other images must not change an output."""
    names, batch = system.batch
    found = system.answers(precision, batch)
    return Outcome(
        joined(
            system.compared(
                image, {name: x[k : k + 1] for name, x in found.items()}, precision.epsilon
            )
            for k, image in enumerate(names)
        )
    )


def _counted(verdicts: Sequence[Verdict]) -> tuple[str, ...]:
    """Return the numbers of all verdicts, of passed or refused ones, and of failed ones."""
    failed = len(failures(verdicts))
    return tuple(map(str, (len(verdicts), len(verdicts) - failed, failed)))


def _cells(verdict: Verdict) -> tuple[str, ...]:
    """Return the cells of a row in the order of `HEADER`."""
    numbers = (verdict.value, verdict.gradient, verdict.reference, verdict.error, verdict.tolerance)
    written = [ABSENT if number is None else f"{number:.4g}" for number in numbers]
    good = "refused" if verdict.value is None and verdict.gradient is None else "passed"
    state = good if verdict.passed else "FAILED"
    return (verdict.case, verdict.precision, *written, state, verdict.note)
