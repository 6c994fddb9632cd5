"""Table 1 as text: the same rows for Markdown, the terminal and the report."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lime_keras.networks import Architecture

from ..markdown_table import aligned
from .labels import exponent
from .measures import MEASURES, Measure


@dataclass(frozen=True)
class Row:
    """One measure, its numbers ready to print; what does not exist is a dash."""

    name: str
    title: str
    ours: str
    oracle: str
    paper: str
    chance: str
    floor: str

    def cells(self) -> tuple[str, ...]:
        """The cells below `header`."""
        return (self.title, self.ours, self.oracle, self.paper, self.chance, self.floor)


def header(summary: Mapping[str, Any]) -> tuple[str, ...]:
    """The table's head, with the title of what is set beside ours."""
    oracle = summary["oracle_title"]
    return ("Measure", "Ours (± 95 % interval)", oracle, "Paper", "Chance", "Floor")


def rows(summary: Mapping[str, Any]) -> list[Row]:
    """The table's rows of `measures.summarise`: the measures that the system has."""
    return [_row(name, measure, summary) for name, measure in MEASURES.items() if name in summary]


def markdown(summary: Mapping[str, Any], architecture: Architecture) -> str:
    """The table in Markdown, columns aligned so that it also reads well in a terminal."""
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
