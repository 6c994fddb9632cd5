"""What each stage of a run achieved, from its curves."""

import csv
from pathlib import Path

_FIRST_COLUMN = "validation_"


def table(run: Path) -> str:
    """Held-out losses before and after each stage, as aligned text; empty without any curve.

    A joined stage begins with the subnetworks that were trained alone, one fed by the other's
    answers: the drop from there is what training them together gains.
    """
    rows = [("stage", "batches", "minutes", "held-out loss", "before", "after")]
    for path in sorted((run / "curves").glob("[0-9]*-*.csv")):
        with path.open(newline="", encoding="utf-8") as file:
            held = list(csv.DictReader(file))
        first, last = held[0], held[-1]
        stage = path.stem.partition("-")[2]
        batches, minutes = last["step"], f"{float(last['seconds']) / 60:.1f}"
        terms = [name for name in first if name.startswith(_FIRST_COLUMN)]
        for term in terms:
            name = term.removeprefix(_FIRST_COLUMN)
            if name == "loss" and len(terms) == 2:
                continue  # The sum of one.
            before, after = (f"{float(row[term]):.4f}" for row in (first, last))
            rows.append((stage, batches, minutes, name, before, after))
            stage = batches = minutes = ""
    if len(rows) == 1:
        return ""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    )
