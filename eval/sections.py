"""The results that `lime-eval` can make: each is a set of files and a section of the report.

Each section is kept as HTML in `OUT/sections/`. Several commands with the same `OUT`, each
measuring one thing, therefore fill one report.
"""

import csv
import io
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lime_keras.data.corpus import Split
from lime_keras.io import photo
from lime_keras.io.atomic import write

from . import kept
from .accuracy import comparison, evaluate, measures, predictions, slices, table
from .report import examples, figures, page, renders

if TYPE_CHECKING:
    from .stability.verdicts import Case

_TITLES = {
    "evaluation": "Accuracy",
    "comparison": "Table 1",
    "tradeoff": "Speed against accuracy",
    "stability": "Extremes",
}
"""Titles of the sections by name, in the order of the report."""


def evaluation(out: Path, run: Path, corpus: Path, *, camera: bool, command: str) -> str:
    """Measure one run, write its files and its section, and return its table in Markdown."""
    evaluated = kept.evaluation(out / "kept", run, corpus, camera=camera)
    lobe = Split(corpus, "test").lobe
    summary = measures.summarise(evaluated) | {"camera": camera, "lobe": lobe}
    choices, worst = examples.choose(evaluated.rows), examples.worst(evaluated.rows)
    shown = examples.read(run, corpus, choices + worst, camera=camera)
    chosen = shown[: len(choices)]
    cards = [renders.card(example, evaluated.rows["relit"]) for example in shown]
    pictures = {"confusion": figures.confusions({"Exponent": evaluate.confusion(evaluated.rows)})}
    if "bin_probabilities" in evaluated.rows:
        pictures["reliability"] = figures.reliability(evaluated.rows)
    section = page.rendered(
        "evaluation.html",
        command=command,
        corpus=corpus.name or str(corpus),
        run=run.name or str(run),
        summary=summary,
        exponent=table.exponent_in_words(evaluated.architecture),
        header=table.HEADER,
        rows=table.rows(summary),
        pictures=pictures,
        slices=slices.rows(evaluated.rows),
        examples=cards[: len(choices)],
        worst=cards[len(choices) :],
    )
    text = table.markdown(summary, evaluated.architecture)
    if (out / "metrics.json").is_file():  # only where an earlier report left its examples
        for stale in (out / "examples").glob("[0-9]" * 5 + ".png"):
            stale.unlink()
    _write_json(out / "metrics.json", summary)
    write(out / "table1.md", text)
    write(out / "confusion.png", pictures["confusion"])
    write(out / "images.csv", _csv(evaluated.rows))
    (out / "examples").mkdir(exist_ok=True)
    for example in chosen:
        photo.write(out / "examples" / f"{example.choice.position:05d}.png", example.photo_srgb)
    write(_section(out, "evaluation"), section)
    return text


def compare(
    out: Path,
    runs: Sequence[Path],
    answers: Sequence[Path],
    corpus: Path,
    *,
    camera: bool,
    command: str,
) -> str:
    """Compare runs and folders of answers, write the files, and return Table 1 in Markdown."""
    # Evaluate.
    named, results = names([*runs, *answers]), out / "kept"
    of_runs, of_answers = list(named.items())[: len(runs)], list(named.items())[len(runs) :]
    rows: dict[str, Mapping[str, np.ndarray]] = {}
    systems: dict[str, comparison.System] = {}
    # Answers come first: reading them is soon done, and may fail.
    for name, given in of_answers:
        answer = predictions.find(given)
        if warning := answer.warning():
            print(f"warning: {warning}", file=sys.stderr)
        rows[name] = kept.predictions(results, answer, corpus)
        systems[name] = comparison.other_system(rows[name])
    for name, run in of_runs:
        evaluated = kept.evaluation(results, run, corpus, camera=camera)
        rows[name] = evaluated.rows
        systems[name] = comparison.system(evaluated.architecture, run)
    # Compare.
    in_order = {name: rows[name] for name in named}
    lobe = Split(corpus, "test").lobe
    compared = comparison.compare(in_order, systems, lobe) | {"camera": camera}
    text = comparison.markdown(compared)
    matrices = {
        f"{name}: {systems[name].name}": evaluate.confusion(rows[name])
        for name in compared["runs"]
        if "predicted_bin" in rows[name]
    }
    pictures = {}
    if matrices:
        pictures["confusions.png"] = (
            figures.confusions(matrices),
            "confusion matrices of the runs",
            "Figure 7: which exponent bin is taken for which, a row a true bin, in per cent.",
        )
    _write(out, "comparison", compared, text, pictures, command)
    return text


def trade(out: Path, runs: Sequence[Path], corpus: Path, *, camera: bool, command: str) -> str:
    """Measure the speed and accuracy of several runs, write the files, and return the tables."""
    from .tradeoff.figures import pareto
    from .tradeoff.measure import measure
    from .tradeoff.table import markdown

    result = measure(names(runs), corpus, out / "kept", out / "models", camera=camera)
    text = markdown(result)
    picture = (
        pareto(result),
        "errors against time",
        "Each point is what a user can ask of one model; on the line, no material is both faster "
        "and better.",
    )
    _write(out, "tradeoff", result, text, {"pareto.png": picture}, command)
    return text


def stability(out: Path, cases: "Sequence[Case]", *, command: str) -> tuple[str, bool]:
    """Run cases of the stability suite, and write their files and their section.

    Returns:
        The tables in Markdown, and whether every check passed.
    """
    from .stability import suite

    verdicts = suite.run(cases)
    text = suite.markdown(verdicts)
    _write(out, "stability", suite.to_json(verdicts), text, {}, command)
    return text, not suite.failures(verdicts)


def write_report(out: Path) -> Path:
    """Write `report.html` from all sections kept in the folder, and return its path."""
    sections = [
        (name, title, path.read_text(encoding="utf-8"))
        for name, title in _TITLES.items()
        if (path := _section(out, name)).is_file()
    ]
    path = out / "report.html"
    write(path, page.whole(sections))
    return path


def names(runs: Sequence[Path]) -> dict[str, Path]:
    """Return the runs by name: the folder's, or `PARENT-FOLDER` where two folders have one name.

    Raises:
        ValueError: if two runs still have the same name.
    """
    folders = [run.resolve() for run in runs]
    of_name = [folder.name for folder in folders]
    named = {
        folder.name
        if of_name.count(folder.name) == 1
        else f"{folder.parent.name}-{folder.name}": run
        for folder, run in zip(folders, runs, strict=True)
    }
    if len(named) < len(runs):
        raise ValueError(
            f"two runs have the same name: rename a folder of {', '.join(map(str, runs))}"
        )
    return named


def _section(out: Path, name: str) -> Path:
    return out / "sections" / f"{name}.html"


def _write(
    out: Path,
    name: str,
    numbers: Any,
    text: str,
    pictures: Mapping[str, page.Picture],
    command: str,
) -> None:
    """Write the files of a section, and the section, which shows its table and its pictures."""
    _write_json(out / f"{name}.json", numbers)
    write(out / f"{name}.md", text)
    for file, (png, *_) in pictures.items():
        write(out / file, png)
    section = page.measured(_TITLES[name], text, pictures.values(), command=command)
    write(_section(out, name), section)


def _write_json(path: Path, content: Any) -> None:
    write(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def _csv(rows: Mapping[str, np.ndarray]) -> str:
    """Return the rows as CSV, a column `(N, K)` as the columns `name_0` to `name_<K - 1>`."""
    columns: dict[str, list[Any]] = {}
    for name, column in rows.items():
        if column.ndim == 1:
            columns[name] = [v.decode() if isinstance(v, bytes) else v for v in column.tolist()]
        else:
            columns |= {f"{name}_{k}": column[:, k].tolist() for k in range(column.shape[1])}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return text.getvalue()
