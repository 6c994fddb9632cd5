"""What became of the inputs: a table, and a folder for each that fell through."""

import collections
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

from lime_keras.eval.markdown_table import aligned

from .verdicts import FELL, KINDS
from .workers import Outcome


class Report:
    """The counts of a run.

    Args:
        doors: names of the doors, in the order of the table.
        seed: seed of the run.
        out: folder for what falls through; it is made when something does.
    """

    def __init__(self, doors: Iterable[str], seed: int, out: Path):
        self._counts: Mapping[str, collections.Counter[str]] = {
            door: collections.Counter() for door in doors
        }
        self._seed, self._out = seed, out

    @property
    def tried(self) -> int:
        """The number of inputs."""
        return sum(counts.total() for counts in self._counts.values())

    @property
    def fell(self) -> int:
        """The number of inputs that fell through."""
        return sum(counts[FELL] for counts in self._counts.values())

    def add(self, outcome: Outcome) -> None:
        """Count an outcome, and keep the files of one that fell through, with the reason."""
        self._counts[outcome.door][outcome.verdict.kind] += 1
        if outcome.verdict.kind != FELL:
            return
        kept = self._out / f"{outcome.door}-seed-{self._seed}-index-{outcome.index}"
        shutil.rmtree(kept, ignore_errors=True)
        shutil.move(outcome.folder, kept / "input")
        about = f"door {outcome.door}, seed {self._seed}, index {outcome.index}\n"
        (kept / "reason.txt").write_text(about + outcome.verdict.reason + "\n", encoding="utf-8")

    def table(self) -> str:
        """Return a row for each door and one for all, in Markdown."""
        total = sum(self._counts.values(), collections.Counter())
        rows = [
            (door, *(f"{count:,}" for count in (counts.total(), *(counts[k] for k in KINDS))))
            for door, counts in (*self._counts.items(), ("all", total))
        ]
        return aligned([("door", "tried", *KINDS), *rows])
