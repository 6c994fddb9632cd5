"""The trade-off in Markdown: conditions of the measurement, tables, and recommendations."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from lime_keras.export.parity import TOLERANCE

from ..accuracy.measures import MEASURES
from ..markdown_table import ABSENT, aligned
from .cases import SUBNETWORK, SYSTEM, compares_runtimes, is_whole
from .costs import TITAN_XP
from .runtimes import ONNX

Row = Mapping[str, Any]
_ERRORS = (
    "mask_iou",
    "exponent_exact",
    "exponent_within_one",
    "log_exponent_mae",
    "diffuse_albedo_mae",
    "specular_albedo_mae",
    "specular_shading_relative",
    "mirror_relative",
    "relighting_psnr",
    "relighting_psnr_unseen",
)
"""Names of the measures in the tables; the JSON holds all measures."""
_COLUMNS: dict[str, Callable[[Row], str]] = {
    "": lambda row: "◆" if row["front"] else "",
    "run": lambda row: row["model"],
    "pixels": lambda row: str(row["image_size"]),
    "runtime": lambda row: row["runtime"],
    "precision": lambda row: row["precision"],
    "only": lambda row: row["part"],
    "batch": lambda row: str(row["batch"]),
    "threads": lambda row: str(row["threads"]),
    "ms": lambda row: _ms(row["latency_ms"]),
    "p95": lambda row: _ms(row["p95_ms"]),
    "images/s": lambda row: f"{row['images_per_second']:.1f}",
    "Δ Keras": lambda row: f"{row['difference']:.0e}",
    "score": lambda row: f"{row['score']:.3f}",
    "parameters": lambda row: _count(row["parameters"]),
    "GFLOP": lambda row: f"{row['gflop']:.2f}",
    "paper, Titan Xp ms": lambda row: _paper(row),
    "model MiB": lambda row: f"{row['model_mib']:.1f}",
    "peak MiB": lambda row: f"{row['peak_memory_mib']:.0f}",
    "cold start s": lambda row: f"{row['cold_start_ms'] / 1e3:.2f}",
    "import": lambda row: f"{row['import_ms'] / 1e3:.2f}",
    "load": lambda row: f"{row['load_ms'] / 1e3:.2f}",
    "first": lambda row: f"{row['first_ms'] / 1e3:.2f}",
    "samples": lambda row: str(row["samples"]),
    "spread": lambda row: f"{100 * row['spread']:.0f} %",
    "busy": lambda row: f"{row['busy']:.1f}",
}
_TEXTS = ("", "run", "runtime", "precision", "only", "measured on")
"""Names of the text columns, which are flush left."""


def markdown(result: Mapping[str, Any]) -> str:
    """Return the tables of the trade-off in Markdown, each under its heading.

    Args:
        result: result of `measure.measure`.
    """
    sections = {
        "The trade": _cross,
        "Recommendations": _recommendations,
        "What a precision does": _precisions,
        "Threads": _threads,
        "Batch": _batches,
        "What is asked for": _parts,
        "Subnetworks, beside the paper's": _subnetworks,
        "Memory, size and cold start": _resources,
    }
    texts = [f"## {title}\n\n{section(result)}" for title, section in sections.items()]
    return "\n\n".join([_conditions(result), *texts]) + "\n"


def _conditions(result: Mapping[str, Any]) -> str:
    machine = result["machine"]
    packages = ", ".join(f"{name} {version}" for name, version in machine["packages"].items())
    instructions = ", ".join(machine["instructions"]) or "unknown instructions"
    seen = ", seen through a camera" if result["camera"] else ""
    busy = min(row["busy"] for row in result["rows"])
    return (
        f"{result['date']}, {machine['processor']} ({instructions}), {machine['cores']} cores, "
        f"{machine['memory_gib']} GiB, {machine['system']}; Python {machine['python']}, "
        f"{packages}. Load as it began: {result['load']:.1f}. Times are medians over the calls of "
        f"{result['rounds']} processes of their own, taken in turns, after warm-up; each had "
        f"{busy:.2f} processors or more, and below 1 other programs were in the way. Errors are "
        f"those of {result['count']} test images of {result['corpus']}{seen}."
    )


def _cross(result: Mapping[str, Any]) -> str:
    rows = sorted(_crossed(result), key=lambda row: row["latency_ms"])
    scored = ", ".join(MEASURES[name].short for name in result["scored"])
    about = (
        f"One image, all {result['machine']['cores']} threads. Score: mean of error ÷ chance over "
        f"{scored}; 0 is perfect, 1 knows nothing. ◆: no variant is both faster and better by "
        "score. Δ Keras: largest difference from Keras in the same precision (eight bits: in "
        f"float32) on test images, relative above 1; up to {TOLERANCE} the errors are Keras' own. "
        "Mask IoU, S and M are each at the run's own number of pixels. A processor without "
        "arithmetic of float16 or bfloat16 emulates it, and is slower then: see its instructions "
        "above. ONNX Runtime on x86 computes float16 models in float32, between casts, whatever "
        "the processor can: they are half the size, not half the time."
    )
    columns = ("", "run", "pixels", "runtime", "precision", "ms", "p95", "Δ Keras", "score")
    return f"{about}\n\n{_rows(rows, *columns, *_shown(rows))}"


def _recommendations(result: Mapping[str, Any]) -> str:
    rule = "The least score within the budget, and of those within 1 % of it the cheapest."
    worth = result["purposes"]
    purposes = map(_purpose, worth, [None, *worth])
    machines = map(_recommendation, result["recommendations"])
    which = "Which weights, in float32 under ONNX Runtime on all threads:"
    return "\n".join([which, "", *purposes, "", rule, "", *machines])


def _purpose(one: Mapping[str, Any], slower: Mapping[str, Any] | None) -> str:
    """Return the line that says what a run is for, beside the next slower one."""
    rate = f"{_ms(one['latency_ms'])} ms, {1e3 / one['latency_ms']:.0f} images/s"
    about = f"({rate}, score {one['score']:.3f})"
    if slower is None:
        said = f"Take **{one['model']}** where errors count: it errs least {about}"
    else:
        times = slower["latency_ms"] / one["latency_ms"]
        said = (
            f"Take **{one['model']}** where time counts: {times:.1f} times as fast as "
            f"{slower['model']}, and worse by {one['score'] - slower['score']:.3f} {about}"
        )
    beaten = [f"{name} is neither faster nor better" for name in one["beaten"]]
    return f"- {'; '.join([said, *beaten])}."


def _recommendation(one: Mapping[str, Any]) -> str:
    row, unit = one["row"], one["unit"]
    name = f"{row['model']}, {row['runtime']}, {row['precision']}"
    if one["within"]:
        said = f"**{name}** ({one['cost']:.1f} {unit}, score {row['score']:.3f})"
    else:
        said = f"**nothing measured meets the budget**; nearest is {name}, {one['cost']:.1f} {unit}"
    return f"- For {one['device']}: {said}. Rule: {one['rule']}."


def _precisions(result: Mapping[str, Any]) -> str:
    rows = _crossed(result)
    shown = _shown(rows)
    plain = {row["model"]: row for row in rows if row["precision"] == "float32"}
    distinct = {(row["model"], row["precision"], row["measured_on"]): row for row in rows}
    lines = [
        [*key, *(_change(row, plain[row["model"]], name) for name in shown)]
        for key, row in distinct.items()
    ]
    about = (
        "The errors of float32 with half their 95 % intervals, and by how much those of another "
        "precision are higher."
    )
    return f"{about}\n\n{_table(['run', 'precision', 'measured on', *map(_title, shown)], lines)}"


def _threads(result: Mapping[str, Any]) -> str:
    rows = [r for r in result["rows"] if is_whole(r) and r["runtime"] == ONNX and r["batch"] == 1]
    rows.sort(key=lambda row: (row["model"], row["precision"], row["threads"]))
    columns = ("run", "precision", "threads", "ms", "p95", "busy")
    return f"ONNX Runtime, one image.\n\n{_rows(rows, *columns)}"


def _batches(result: Mapping[str, Any]) -> str:
    rows = sorted(filter(is_whole, _plain(result)), key=lambda row: (row["model"], row["batch"]))
    columns = ("run", "batch", "ms", "p95", "images/s", "peak MiB")
    return f"ONNX Runtime, float32, all threads; ms of a whole batch.\n\n{_rows(rows, *columns)}"


def _parts(result: Mapping[str, Any]) -> str:
    rows = [row for row in _plain(result) if row["batch"] == 1]
    rows.sort(key=lambda row: (row["model"], row["gflop"]))
    about = "As `lime-estimate --only` asks: ONNX Runtime, float32, one image, all threads."
    columns = ("run", "only", "ms", "p95", "GFLOP", "model MiB", "peak MiB")
    return f"{about}\n\n{_rows(rows, *columns)}"


def _subnetworks(result: Mapping[str, Any]) -> str:
    rows = [row for row in result["rows"] if row["kind"] == SUBNETWORK]
    rows += [row for row in _plain(result) if is_whole(row) and row["batch"] == 1]
    rows.sort(key=lambda row: row["model"])
    about = (
        "ONNX Runtime, float32, one image, all threads, each alone. The paper's networks, timed on "
        "a Titan Xp, are of unknown width and see 256 × 256 pixels."
    )
    columns = ("run", "pixels", "only", "parameters", "GFLOP", "ms", "paper, Titan Xp ms")
    return f"{about}\n\n{_rows(rows, *columns)}"


def _paper(row: Row) -> str:
    """Return the paper's time for a subnetwork, or the sum of all for a whole system."""
    milliseconds = sum(TITAN_XP.values()) if is_whole(row) else TITAN_XP.get(row["part"])
    return ABSENT if milliseconds is None else f"{milliseconds:.2f}"


def _resources(result: Mapping[str, Any]) -> str:
    about = (
        "One image, all threads. Peak memory is the whole process's. Cold start: from the start of "
        "the process to its first answer, with the files in the system's cache; its parts are the "
        "import of the runtime, the loading of the model and the first answer. Spread: of the "
        "rounds' medians. Busy: processor seconds a second."
    )
    columns = (
        *("run", "runtime", "precision", "model MiB", "peak MiB", "cold start s", "import", "load"),
        *("first", "images/s", "samples", "spread", "busy"),
    )
    return f"{about}\n\n{_rows(_crossed(result), *columns)}"


def _crossed(result: Mapping[str, Any]) -> list[Row]:
    return [row for row in result["rows"] if compares_runtimes(row, result["machine"]["cores"])]


def _plain(result: Mapping[str, Any]) -> list[Row]:
    """Return the rows of systems and their parts in ONNX Runtime, float32, on all threads."""
    wanted = ("kind", "runtime", "precision", "threads")
    of = (SYSTEM, ONNX, "float32", result["machine"]["cores"])
    return [row for row in result["rows"] if tuple(row[name] for name in wanted) == of]


def _shown(rows: Sequence[Row]) -> list[str]:
    """Return the measures of `_ERRORS` that at least one row has."""
    return [name for name in _ERRORS if any(name in row["errors"] for row in rows)]


def _change(row: Row, plain: Row, name: str) -> str:
    """Return a measure of float32 with half its interval, or how another precision changes it."""
    if name not in row["errors"]:
        return ABSENT
    unit = MEASURES[name].unit
    if row["precision"] == "float32":
        return unit.with_interval(row["errors"][name], row["interval"][name])
    change = row["errors"][name] - plain["errors"][name]
    return ("−" if change < 0 else "+") + unit.number(abs(change))


def _ms(value: float) -> str:
    return f"{value:.1f}" if value >= 10 else f"{value:.2f}"


def _count(value: float) -> str:
    return f"{value / 1e6:.2f} M" if value >= 1e6 else f"{value / 1e3:.0f} k"


def _rows(rows: Iterable[Row], *columns: str) -> str:
    """Return a table with a line for each row; columns are names of `_COLUMNS` or of measures."""
    lines = [[_cell(row, column) for column in columns] for row in rows]
    return _table([*map(_title, columns)], lines)


def _cell(row: Row, column: str) -> str:
    if column in MEASURES:
        return MEASURES[column].unit.number(row["errors"].get(column))
    return _COLUMNS[column](row)


def _title(column: str) -> str:
    return MEASURES[column].short if column in MEASURES else column


def _table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    texts = [index for index, title in enumerate(header) if title in _TEXTS]
    return aligned([header, *lines], texts)
