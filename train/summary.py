"""The summary of a run: held-out losses and measures before and after each stage."""

import csv
from collections.abc import Iterable
from pathlib import Path

_LOSS, _MEASURE = "validation_", "measure_"


def table(run: Path) -> str:
    """Return held-out losses and measures before and after each stage, as aligned text.

    The text is empty if the run has no curves.

    Before a joined stage, its subnetworks are as trained alone, but read one another's predictions.
    So the difference between before and after is the gain of joined training.
    """
    rows = [("stage", "batches", "minutes", "held-out loss or measure", "before", "after")]
    for path in sorted((run / "curves").glob("[0-9]*-*.csv")):
        with path.open(newline="", encoding="utf-8") as file:
            held = list(csv.DictReader(file))
        first, last = held[0], held[-1]
        stage = path.stem.partition("-")[2]
        batches, minutes = last["step"], f"{float(last['seconds']) / 60:.1f}"
        for column in _columns(first):
            # Rows that an earlier version wrote have no measures.
            before, after = (
                f"{float(row[column]):.4f}" if row[column] else "" for row in (first, last)
            )
            name = column.removeprefix(_LOSS).removeprefix(_MEASURE)
            rows.append((stage, batches, minutes, name, before, after))
            stage = batches = minutes = ""
    if len(rows) == 1:
        return ""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )


def _columns(names: Iterable[str]) -> list[str]:
    """Return the columns of losses, without the sum if there is only one, and of measures."""
    losses = [name for name in names if name.startswith(_LOSS)]
    if len(losses) == 2:
        losses.remove(f"{_LOSS}loss")
    return [*losses, *(name for name in names if name.startswith(_MEASURE))]
