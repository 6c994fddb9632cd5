"""The summary of a run: validation losses and measures before and after each stage."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

from lime_keras.io import untrusted

_LOSS, _MEASURE = "validation_", "measure_"


def table(run: Path) -> str:
    """Return validation losses and measures before and after each stage, as aligned text.

    The text is empty if the run has no curves.

    Before a joined stage, its subnetworks are as trained alone, but read one another's predictions.
    So the difference between before and after is the gain of joined training.
    """
    rows = [("stage", "batches", "minutes", "validation loss or measure", "before", "after")]
    for path in sorted((run / "curves").glob("[0-9]*-*.csv")):
        with path.open(newline="", encoding="utf-8") as file:
            curve = list(csv.DictReader(file))
        first, last = curve[0], curve[-1]
        stage = path.stem.partition("-")[2]
        batches, minutes = last["step"], f"{float(last['seconds']) / 60:.1f}"
        for column in _columns(first):
            before, after = (f"{float(row[column]):.4f}" for row in (first, last))
            name = column.removeprefix(_LOSS).removeprefix(_MEASURE)
            rows.append((stage, batches, minutes, name, before, after))
            stage = batches = minutes = ""
    return _aligned(rows) if len(rows) > 1 else ""


def evaluation(run: Path) -> str:
    """Return the measures of the whole system on the validation set, as aligned text.

    The text is empty if the run's system is not complete, and so not evaluated.
    """
    path = run / "evaluation.json"
    if not path.is_file():
        return ""
    with untrusted.naming(path, "measures", "delete it and run the same command again"):
        content = untrusted.read_json(path)
        rows = [("whole system", f"of {content['examples']} validation examples")]
        for name, value in content["measures"].items():
            rows.append((name, "not finite" if value is None else f"{value:.4f}"))
    return _aligned(rows)


def _aligned(rows: Sequence[tuple[str, ...]]) -> str:
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
