"""Table 1 as text: the same rows for Markdown, the terminal and the report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lime_keras.networks import Architecture

from .measures import MEASURES, Measure

HEADER = ("Measure", "Ours (± 95 % interval)", "Oracle", "Paper", "Chance", "Floor")
_ABSENT = "–"


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
        """The cells below `HEADER`."""
        return (self.title, self.ours, self.oracle, self.paper, self.chance, self.floor)


def rows(summary: Mapping[str, Any]) -> list[Row]:
    """The table's rows of `measures.summarise`: the measures that the system has."""
    return [_row(name, measure, summary) for name, measure in MEASURES.items() if name in summary]


def oracle(architecture: Architecture) -> str:
    """Which subnetworks the oracle is, and what they are given."""
    if architecture.system == "reflectance-map":
        return "MaterialNet given the true reflectance map"
    layers = "mask, S and M" if architecture.mirror else "mask and S"
    return f"ExponentNet and AlbedoNet given the true {layers}"


def exponent(architecture: Architecture) -> str:
    """How an exponent is read off the answer."""
    if architecture.exponent == "regression":
        return "the system answers log10 s itself; its bin is the one that s falls into"
    return "log10 s is the expected value over the eight classes, or that of the winning bin"


def markdown(summary: Mapping[str, Any], architecture: Architecture) -> str:
    """The table in Markdown, columns aligned so that it also reads well in a terminal."""
    lines = [HEADER, *(row.cells() for row in rows(summary))]
    return f"{aligned(lines)}\n{_note(summary, architecture)}\n"


def aligned(lines: Sequence[tuple[str, ...]]) -> str:
    """A Markdown table of a header and rows, the first column flush left, numbers flush right."""
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    text = [_line(line, widths) for line in lines]
    rule = "|".join(["", "-" * (widths[0] + 2), *("-" * (width + 1) + ":" for width in widths[1:])])
    return "\n".join([text[0], rule + "|", *text[1:]]) + "\n"


def number(value: float | None, unit: str = "") -> str:
    """A measure to print: per cent and decibel with two decimals, others with four."""
    if value is None:
        return _ABSENT
    return {"%": f"{100 * value:.2f} %", "dB": f"{value:.2f} dB"}.get(unit, f"{value:.4f}")


def with_interval(value: float, interval: Sequence[float], unit: str = "") -> str:
    """A measure and half the width of its interval, such as `45.07 ± 1.20 %`."""
    scale = 100 if unit == "%" else 1
    digits = 2 if unit else 4
    half = (interval[1] - interval[0]) / 2
    return f"{scale * value:.{digits}f} ± {scale * half:.{digits}f} {unit}".rstrip()


def _row(name: str, measure: Measure, summary: Mapping[str, Any]) -> Row:
    compared = {
        kind: number(summary[kind].get(name), measure.unit)
        for kind in ("oracle", "paper", "chance", "floor")
    }
    ours = with_interval(summary[name], summary["interval"][name], measure.unit)
    arrow = {True: " ↑", False: " ↓", None: ""}[measure.more_is_better]
    return Row(name, measure.title + arrow, ours, **compared)


def _line(cells: tuple[str, ...], widths: list[int]) -> str:
    """One line: the first column flush left, the numbers flush right."""
    padded = [cells[0].ljust(widths[0])]
    padded += [cell.rjust(width) for cell, width in zip(cells[1:], widths[1:], strict=True)]
    return f"| {' | '.join(padded)} |"


def _note(summary: Mapping[str, Any], architecture: Architecture) -> str:
    return (
        f"{summary['count']} test images, answered by {architecture.description}. Exponent: "
        f"{exponent(architecture)}. Oracle: {oracle(architecture)}. Chance: an answer that knows "
        "nothing. Floor: what perfect classification into bins still errs by."
    )
