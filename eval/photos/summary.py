"""The results on photos: the measures of each model and mask, and the photos sorted by gloss."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..markdown_table import ABSENT, aligned
from . import measures
from .answers import OWN, Answers
from .folder import FINISHES, Photo

Columns = Mapping[str, np.ndarray]
"""Columns `(N, …)` of one model and mask: those of `Answers` and of `derived`."""
_SHOWN = {"lobe_peak": ".3g", "exponent": ".3g", "specular_albedo": ".3f"}
"""Columns of the list of photos, with their formats."""
_NUMBERS = (
    *("coverage", "iou", "diffuse_albedo", "specular_albedo", "exponent", "lobe_peak"),
    *("specular_ratio", "object_colour", "colour", "colour_grey", "colour_frame", "colour_others"),
    *("unexplained", "unexplained_grey", "unexplained_frame", "unexplained_others"),
)
"""Columns of `derived` that are kept for each photo."""
_ANGLES = {"colour": measures.angle, "unexplained": measures.unexplained_angle}


@dataclass(frozen=True)
class Measure:
    """A measure on photos.

    Attributes:
        title: name of the measure.
        unit: symbol after the number; a share, of unit %, is printed times 100.
        digits: number of digits after the decimal point.
        more_is_better: whether a higher value is better; None if neither direction is.
        counted: name of the column `(N,)` that says which photos count; None for all.
        value: function from the columns of these photos to the measure, NaN if there is none.
        samples: function from the same columns to its 1,000 bootstrap samples, `(1000,)`.
    """

    title: str
    unit: str
    digits: int
    more_is_better: bool | None
    counted: str | None
    value: Callable[[Columns], float]
    samples: Callable[[Columns], np.ndarray]

    def of(self, columns: Columns) -> Columns:
        """Return the columns of the photos that count."""
        if self.counted is None:
            return columns
        return {name: column[columns[self.counted]] for name, column in columns.items()}

    def text(self, result: Mapping[str, Any] | None) -> str:
        """Return a result of `summarise` with its interval and mark, such as `0.72 [0.44, 0.93] −`.

        A dash stands for None.
        """
        if result is None:
            return ABSENT
        scale = 100 if self.unit == "%" else 1
        text = f"{scale * result['value']:.{self.digits}f} {self.unit}".rstrip()
        if result["interval"] is not None:
            low, high = (f"{scale * end:.{self.digits}f}" for end in result["interval"])
            text += f" [{low}, {high}]"
        return f"{text} {self._mark(result.get('difference'))}".rstrip()

    def _mark(self, difference: Sequence[float] | None) -> str:
        """Return + or − for an interval of differences that lies on one side of 0, else nothing."""
        if difference is None or self.more_is_better is None or difference[0] <= 0 <= difference[1]:
            return ""
        return "+" if (difference[0] > 0) == self.more_is_better else "−"


def _order(title: str, score: str, counted: str, pair: str | None = None) -> Measure:
    """Return the measure of the order of glossy and matte photos by a column of scores."""

    def arguments(of: Columns) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        return of[score], of["glossy"], None if pair is None else of[pair]

    return Measure(
        title,
        unit="",
        digits=2,
        more_is_better=True,
        counted=counted,
        value=lambda of: measures.gloss_order(*arguments(of)),
        samples=lambda of: measures.gloss_order_samples(*arguments(of)),
    )


def _mean(
    title: str,
    column: str,
    unit: str,
    digits: int,
    more_is_better: bool | None = None,
    counted: str | None = None,
) -> Measure:
    """Return the measure of a column's mean."""
    return Measure(
        title,
        unit,
        digits,
        more_is_better,
        counted,
        value=lambda of: measures.mean(of[column]),
        samples=lambda of: measures.mean_samples(of[column]),
    )


def _geometric_mean(title: str, column: str, counted: str) -> Measure:
    """Return the measure of the geometric mean of a column of ratios."""
    return Measure(
        title,
        unit="×",
        digits=2,
        more_is_better=None,
        counted=counted,
        value=lambda of: float(np.exp(measures.mean(np.log(of[column])))),
        samples=lambda of: np.exp(measures.mean_samples(np.log(of[column]))),
    )


def _colours(kind: str, to: str) -> dict[str, Measure]:
    """Return the measures of angles to the object's colours: of m_d, and of blind answers."""
    answered = {"": "m_d", "_grey": "grey", "_frame": "whole photo", "_others": "others' objects"}
    return {
        f"{kind}_angle{end}": _mean(
            f"Colour, {what} to {to}", f"{kind}{end}", "°", 1, None if end else False
        )
        for end, what in answered.items()
    }


_DIELECTRIC = f"m_s of dielectrics, over {measures.dielectric_specular_albedo():.2f}"
MEASURES = {
    "gloss_order_exponent": _order("Gloss order (AUC) by log10 s", "log_exponent", "labelled"),
    "gloss_order_peak": _order("Gloss order (AUC) by m_s · c(s)", "lobe_peak", "labelled"),
    "gloss_order_exponent_in_pairs": _order(
        "Gloss order in pairs by log10 s", "log_exponent", "paired", "pair"
    ),
    "gloss_order_peak_in_pairs": _order(
        "Gloss order in pairs by m_s · c(s)", "lobe_peak", "paired", "pair"
    ),
    "specular_ratio": _geometric_mean(
        f"{_DIELECTRIC}, geometric mean", "specular_ratio", "dielectric"
    ),
    "specular_within_2": _mean(
        f"{_DIELECTRIC}, within a factor of 2", "within_2", "%", 0, True, "dielectric"
    ),
    **_colours("colour", "mean pixel"),
    **_colours("unexplained", "what pixels allow"),
    "iou": _mean("IoU with the given mask", "iou", "%", 1, True, "with_mask"),
    "unanswered": _mean("Photos without an answer", "unanswered", "%", 0, False),
}
"""All measures by name, in the order of the table."""


def derived(photos: Sequence[Photo], columns: Columns) -> dict[str, np.ndarray]:
    """Return the columns of an answer with the photos' labels and the measures of each photo.

    Args:
        photos: photos, `(N,)`.
        columns: columns of one model and mask (`Answers`).

    Returns:
        The columns; the labels `labelled`, `glossy`, `dielectric`, `paired` and `pair`;
        `with_mask`, where there is an IoU; `specular_ratio` and `within_2`, of m_s over that of a
        dielectric; `unanswered`; and `colour` and `unexplained`, the angles of m_d in degrees, with
        those of answers that do not look at the object: `_grey`, `_frame` and `_others`.
    """
    ratio = measures.specular_ratio(columns["specular_albedo"])
    pixels = columns["object_colour"]
    angles = {}
    for kind, distance in _ANGLES.items():
        angles[kind] = distance(columns["diffuse_albedo"], pixels)
        angles[f"{kind}_grey"] = distance(np.ones(3), pixels)
        angles[f"{kind}_frame"] = distance(columns["frame_colour"], pixels)
        angles[f"{kind}_others"] = measures.others(pixels, distance)
    return {
        **columns,
        "labelled": np.array([photo.finish is not None for photo in photos]),
        "glossy": np.array([photo.finish == FINISHES[0] for photo in photos]),
        "dielectric": np.array([photo.dielectric for photo in photos]),
        "paired": np.array([bool(photo.finish and photo.pair) for photo in photos]),
        "pair": np.array([photo.pair or "" for photo in photos]),
        "with_mask": ~np.isnan(columns["iou"]),
        "specular_ratio": ratio,
        "within_2": measures.within_factor_of_2(ratio).astype(float),
        "unanswered": 1.0 - columns["found"],
        **angles,
    }


def summarise(photos: Sequence[Photo], answers: Answers) -> dict[str, Any]:
    """Return the content of `photos.json`.

    Returns:
        The numbers of photos: `count`, `glossy`, `matte`, `dielectrics`, `masks`; `expected`, the
        m_s of a dielectric; `columns`: for each model and mask its `model`, its `mask`, and each of
        `MEASURES` that there is, with `value`, `interval` (95 % bootstrap over the photos, None for
        a single one), `count` of photos and, from the second model on, `difference`: the interval
        of the difference from the first model on the same photos; and `photos`, the numbers of each
        photo with each model and each of its masks, sorted by `by_gloss`; colours are linear RGB,
        angles in degrees, and a number that there is none of is None.
    """
    columns = {key: derived(photos, of_key) for key, of_key in answers.items()}
    first = next(iter(columns))[0]
    results = []
    for (model, mask), own in columns.items():
        reference = None if model == first else columns[first, mask]
        found = {name: _result(measure, own, reference) for name, measure in MEASURES.items()}
        known = {name: result for name, result in found.items() if result is not None}
        results.append({"model": model, "mask": mask, "measures": known})
    some = next(iter(columns.values()))
    return {
        "count": len(photos),
        **{finish: sum(photo.finish == finish for photo in photos) for finish in FINISHES},
        "dielectrics": int(some["dielectric"].sum()),
        "masks": int(some["with_mask"].sum()),
        "expected_specular_albedo": measures.dielectric_specular_albedo(),
        "columns": results,
        "photos": _rows(photos, columns, by_gloss(answers)),
    }


def _result(measure: Measure, own: Columns, reference: Columns | None) -> dict[str, Any] | None:
    """Return the value of a measure with its interval; None if it has none here."""
    counted = measure.of(own)
    value = measure.value(counted)
    if np.isnan(value):
        return None
    samples = measure.samples(counted)
    result = {
        "value": value,
        "interval": measures.interval(samples),
        "count": len(counted["found"]),
    }
    if reference is not None:
        result["difference"] = measures.interval(samples - measure.samples(measure.of(reference)))
    return result


def by_gloss(answers: Answers) -> list[int]:
    """Return the positions of the photos by the m_s · c(s) of the first model with its own mask.

    The glossiest comes first; photos without an answer come last.
    """
    peak = next(iter(answers.values()))["lobe_peak"]
    return np.argsort(-np.nan_to_num(peak, nan=-1.0), kind="stable").tolist()


def markdown(photos: Sequence[Photo], summary: Mapping[str, Any]) -> str:
    """Return the results in Markdown: the measures, and the photos sorted by gloss.

    Args:
        photos: photos that were evaluated.
        summary: result of `summarise`.
    """
    columns = summary["columns"]
    names = [f"{one['model']}, {one['mask']}" for one in columns]
    lines = [["Measure", "Photos", *names]]
    for name, measure in MEASURES.items():
        results = [one["measures"].get(name) for one in columns]
        known = [result for result in results if result is not None]
        if known:
            texts = [measure.text(result) for result in results]
            lines.append([measure.title, str(known[0]["count"]), *texts])
    models = list(dict.fromkeys(one["model"] for one in columns))
    return f"{aligned(lines)}\n\n{_note(summary, models)}\n\n{_listed(photos, summary, models)}\n"


def _note(summary: Mapping[str, Any], models: Sequence[str]) -> str:
    """Return what the table's photos, masks, brackets and marks are, in sentences."""
    sentences = [
        f"{summary['count']} photos: {summary['glossy']} labelled glossy, {summary['matte']} "
        f"matte, {summary['dielectrics']} dielectric; {summary['masks']} with a mask.",
        "In brackets the 95 % interval of a bootstrap over the photos.",
        "AUC 0.5 is chance, 1 the right order.",
    ]
    if summary["masks"]:
        sentences.append("Given mask: photos without one are answered with the model's own.")
    if len(models) > 1:
        sentences.append(
            f"+ and − mark what is better and worse than {models[0]} by more than the 95 % "
            "interval of the difference on the same photos."
        )
    return " ".join(sentences)


def _listed(photos: Sequence[Photo], summary: Mapping[str, Any], models: Sequence[str]) -> str:
    """Return the photos sorted by gloss as a table, with the answers of each model's own mask."""
    with_finish = any(photo.finish for photo in photos)
    header = ["Photo", *(["finish"] if with_finish else [])]
    for model in models:
        begin = f"{model}: " if len(models) > 1 else ""
        header += [f"{begin}m_s · c(s)", *(f"{begin}{name}" for name in ("s", "m_s"))]
    lines: dict[str, list[str]] = {}
    for row in summary["photos"]:
        if row["mask"] == OWN:
            cells = [row["photo"], *([row["finish"] or ABSENT] if with_finish else [])]
            lines.setdefault(row["photo"], cells).extend(
                ABSENT if row[name] is None else f"{row[name]:{form}}"
                for name, form in _SHOWN.items()
            )
    return aligned([header, *lines.values()], (0, 1) if with_finish else (0,))


def _rows(
    photos: Sequence[Photo], columns: Mapping[tuple[str, str], Columns], order: Sequence[int]
) -> list[dict[str, Any]]:
    """Return a row for each photo, model and mask, a photo's rows together (see `summarise`)."""
    shown = []
    for position in order:
        photo = photos[position]
        labels = {"finish": photo.finish, "dielectric": photo.dielectric, "pair": photo.pair}
        for (model, mask), of in columns.items():
            if mask == OWN or of["mask_given"][position]:
                numbers = {name: _number(of[name][position]) for name in _NUMBERS}
                if not photo.dielectric:
                    numbers["specular_ratio"] = None
                shown.append(
                    {"photo": photo.name, **labels, "model": model, "mask": mask, **numbers}
                )
    return shown


def _number(value: np.ndarray) -> Any:
    """Return a number or a list of numbers for JSON, NaN as None."""
    if value.ndim:
        return [_number(one) for one in value]
    return None if np.isnan(value) else float(f"{value:.6g}")
