"""Table 1 of one run as text: the same rows for Markdown, the terminal and the report."""

from collections.abc import Mapping
from typing import Any

from lime_keras.networks import Architecture

from ..markdown_table import aligned
from .measures import MEASURES, Measure

HEADER = ("Measure", "Ours (± 95 % interval)", "With the true mask", "Paper", "Chance", "Floor")
"""Titles of the columns."""
UNITS = {
    "furnace": "m_s and S are normalised to the white furnace; the paper's m_s has another unit, "
    "that of its Eq. 3 without a normaliser",
    "printed": "m_s and S are in the paper's unit: the lobe of its Eq. 3 as printed",
}
"""The unit of m_s and S in words, by the lobe of a corpus."""


def rows(summary: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Return the cells of a result of `measures.summarise`, in the order of `HEADER`.

    There is a row for each measure that the system has; missing numbers are dashes.
    """
    return [_cells(name, measure, summary) for name, measure in MEASURES.items() if name in summary]


def markdown(summary: Mapping[str, Any], architecture: Architecture) -> str:
    """Return the table in Markdown, with columns aligned to read well in a terminal."""
    lines = [HEADER, *rows(summary)]
    return f"{aligned(lines)}\n\n{_note(summary, architecture)}\n"


def exponent_in_words(architecture: Architecture) -> str:
    """Return how log10 s and its bin are computed from the system's outputs, in words."""
    if architecture.exponent == "regression":
        return "the system answers log10 s itself; its bin is the one that s falls into"
    return "log10 s is the expected value over the eight classes, or that of the winning bin"


def _cells(name: str, measure: Measure, summary: Mapping[str, Any]) -> tuple[str, ...]:
    ours = measure.unit.with_interval(summary[name], summary["interval"][name])
    arrow = {True: " ↑", False: " ↓", None: ""}[measure.more_is_better]
    compared = ("true_mask", "paper", "chance", "floor")
    others = (measure.unit.number(summary[kind].get(name)) for kind in compared)
    return (measure.title + arrow, ours, *others)


def _note(summary: Mapping[str, Any], architecture: Architecture) -> str:
    return (
        f"{summary['count']} test images, answered by {architecture.description}. Exponent: "
        f"{exponent_in_words(architecture)}. Chance: the best answer that is the same for every "
        "image. Floor: what perfect classification into bins still errs by. "
        f"{UNITS[summary['lobe']]}."
    )
