"""Table 1 of one run as text: the same rows for Markdown, the terminal and the report."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lime_keras.networks import Architecture

from ..markdown_table import aligned
from .labels import exponent
from .measures import MEASURES, Measure


@dataclass(frozen=True)
class Row:
    """A row of the table: a measure with its numbers as text, a dash for missing ones."""

    name: str
    title: str
    ours: str
    oracle: str
    paper: str
    chance: str
    floor: str

    def cells(self) -> tuple[str, ...]:
        """Return the cells in the order of `header`."""
        return (self.title, self.ours, self.oracle, self.paper, self.chance, self.floor)


def header(summary: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the header of the table; its third column has the title of the oracle."""
    oracle = summary["oracle_title"]
    return ("Measure", "Ours (± 95 % interval)", oracle, "Paper", "Chance", "Floor")


def rows(summary: Mapping[str, Any]) -> list[Row]:
    """Return the rows of the table: the measures that the system has.

    Args:
        summary: result of `measures.summarise`.
    """
    return [_row(name, measure, summary) for name, measure in MEASURES.items() if name in summary]


def markdown(summary: Mapping[str, Any], architecture: Architecture) -> str:
    """Return the table in Markdown, with columns aligned to read well in a terminal."""
    lines = [header(summary), *(row.cells() for row in rows(summary))]
    return f"{aligned(lines)}\n\n{_note(summary, architecture)}\n"


def _row(name: str, measure: Measure, summary: Mapping[str, Any]) -> Row:
    compared = {
        kind: measure.unit.number(summary[kind].get(name))
        for kind in ("oracle", "paper", "chance", "floor")
    }
    ours = measure.unit.with_interval(summary[name], summary["interval"][name])
    arrow = {True: " ↑", False: " ↓", None: ""}[measure.more_is_better]
    return Row(name, measure.title + arrow, ours, **compared)


def _note(summary: Mapping[str, Any], architecture: Architecture) -> str:
    return (
        f"{summary['count']} test images, answered by {architecture.description}. Exponent: "
        f"{exponent(architecture)}. {summary['oracle_title']}: {summary['oracle_is']}. Chance: an "
        "answer that knows nothing. Floor: what perfect classification into bins still errs by."
    )
