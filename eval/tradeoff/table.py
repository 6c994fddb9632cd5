"""The trade in Markdown: conditions of the measurement, tables, and advice."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from ..accuracy.measures import MEASURES
from ..markdown_table import ABSENT, aligned
from .cases import NETWORKS, PAGE, PHOTO, STREAM
from .recommendation import Row

_ERRORS = (
    *("mask_iou", "exponent_exact", "exponent_within_one", "log_exponent_mae"),
    *("diffuse_albedo_mae", "specular_albedo_mae", "specular_shading_relative"),
    *("mirror_relative", "relighting_psnr", "relighting_psnr_unseen"),
)
"""Names of the measures in the table of errors; the JSON holds all measures."""
_TITAN_XP_MS = 13.72  # the paper's time for its five subnetworks on a Titan Xp
_COLUMNS: dict[str, Callable[[Row], str]] = {
    "model": lambda row: row["model"],
    "runtime": lambda row: row["runtime"],
    "precision": lambda row: row["precision"],
    "asked for": lambda row: row["asked"],
    "cores": lambda row: str(row["threads"]),
    "ms": lambda row: _ms(row["ms"]),
    "p95": lambda row: _ms(row["p95_ms"]),
    "networks ms": lambda row: _ms(row["networks_ms"]) if "networks_ms" in row else ABSENT,
    "score": lambda row: f"{row['score']:.3f}" if "score" in row else ABSENT,
    "model MiB": lambda row: f"{row['model_mib']:.1f}",
    "peak MiB": lambda row: f"{row['peak_memory_mib']:.0f}" if "busy" in row else ABSENT,
    "cold start s": lambda row: f"{row['cold_start_s']:.2f}",
    "spread": lambda row: f"{100 * row['spread']:.0f} %",
    "busy": lambda row: f"{row['busy']:.1f}" if "busy" in row else ABSENT,
}
_TEXTS = ("model", "runtime", "precision", "asked for")
"""Names of the text columns, which are flush left."""
_TIMES = (
    *("model", "precision", "asked for", "cores", "ms", "p95", "networks ms", "score"),
    *("peak MiB", "cold start s", "spread", "busy"),
)


def markdown(result: Mapping[str, Any]) -> str:
    """Return the tables of a result of `measure.measure` in Markdown, each under its heading."""
    rows = sorted(result["rows"], key=lambda row: row["ms"])

    def of(kind: str) -> list[Row]:
        return [row for row in rows if row["kind"] == kind]

    sections = {
        "What to take": _advice(result["advice"]),
        "A photo": f"`Estimator.estimate` of a picture of 640 × 480.\n\n{_table(of(PHOTO))}",
        "A frame of a stream": f"`Session.process`, as in `lime-live`.\n\n{_table(of(STREAM))}",
        "A frame of the page without Python": _page(of(PAGE)),
        "Runtimes that other programs load": _networks(of(NETWORKS)),
        "Errors": _errors(result),
    }
    texts = [f"## {title}\n\n{text}" for title, text in sections.items()]
    return "\n\n".join([_conditions(result), *texts]) + "\n"


def _conditions(result: Mapping[str, Any]) -> str:
    machine = result["machine"]
    packages = ", ".join(f"{name} {version}" for name, version in machine["packages"].items())
    instructions = ", ".join(machine["instructions"]) or "unknown instructions"
    camera = ", photographed" if result["camera"] else ""
    scored = ", ".join(MEASURES[name].short for name in result["scored"])
    begun, ended = result["timed"]
    return (
        f"{machine['processor']} ({instructions}), {machine['cores']} cores, "
        f"{machine['memory_gib']} GiB, {machine['system']}; Python {machine['python']}, "
        f"{packages}. Load as it began: {result['load']:.1f}. Times are medians over the calls of "
        f"{result['rounds']} processes of their own, taken in turns from {begun} to {ended}, "
        "after warm-up, from the picture in memory to the answer in memory; the networks alone "
        "beside. Busy: processor seconds a second; far below the cores, other programs were in "
        f"the way. Errors are those of {result['count']} images of {result['corpus']}{camera}, by "
        "the same engine. "
        f"Score: mean of error ÷ chance over {scored}; 0 is perfect, 1 knows nothing. `paper` is "
        f"the paper's architecture, untrained (on a Titan Xp: {_TITAN_XP_MS} ms in its networks)."
        + "".join(f" {name} is left out: {why}." for name, why in result["refused"].items())
    )


def _advice(advice: Sequence[Mapping[str, Any]]) -> str:
    lines = []
    for one in advice:
        row, budget = one["row"], one["budget_ms"]
        choice = f"**{row['model']}** in {row['precision']} ({_ms(row['ms'])} ms"
        choice += f", score {row['score']:.3f})"
        if not one["within"]:
            choice = f"nothing measured takes {_ms(budget)} ms or less; nearest is {choice}"
        typed = "\n".join(f"      {command}" for command in one["commands"])
        lines.append(f"- For {one['use']}: {choice}.\n\n{typed}\n")
    return "\n".join(lines)


def _page(rows: Sequence[Row]) -> str:
    columns = ("model", "asked for", "cores", "ms", "p95", "model MiB", "cold start s", "spread")
    about = "The engine of `lime-live --static` in Chromium, in WebAssembly, without the drawing."
    return f"{about}\n\n{_table(rows, columns)}" if rows else "It was not measured."


def _networks(rows: Iterable[Row]) -> str:
    columns = ("model", "runtime", "ms", "p95", "model MiB", "peak MiB", "cold start s", "busy")
    about = "All outputs of one square picture of the networks' size; the object is not looked for."
    return f"{about}\n\n{_table(rows, columns)}"


def _errors(result: Mapping[str, Any]) -> str:
    distinct = {(row["model"], row["precision"]): row for row in result["rows"] if "errors" in row}
    shown = [name for name in _ERRORS if any(name in row["errors"] for row in distinct.values())]
    lines = [
        [
            *key,
            *(
                MEASURES[name].unit.with_interval(row["errors"][name], row["interval"][name])
                if name in row["errors"]
                else ABSENT
                for name in shown
            ),
        ]
        for key, row in distinct.items()
    ]
    header = ["model", "precision", *(MEASURES[name].short for name in shown)]
    return f"With half their 95 % intervals.\n\n{aligned([header, *lines], (0, 1))}"


def _table(rows: Iterable[Row], columns: Sequence[str] = _TIMES) -> str:
    """Return a table with a line for each row; columns are names of `_COLUMNS`."""
    lines = [[_COLUMNS[column](row) for column in columns] for row in rows]
    texts = [index for index, title in enumerate(columns) if title in _TEXTS]
    return aligned([list(columns), *lines], texts)


def _ms(value: float) -> str:
    return f"{value:.1f}" if value >= 10 else f"{value:.2f}"
