"""The figure of the trade: time against the score, for a photo, a stream and the page."""

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter
from matplotlib.typing import FillStyleType

from ..report.figures import DPI, INK, TONES, WHITE, dress, to_png
from .cases import ASKED, PAGE, PAPER, PHOTO, STREAM
from .recommendation import FRAME_MS, front

_MARKERS = {"mask": "s", "material": "o", "everything": "D", "with the light": "^"}
_FILLED: dict[str, FillStyleType] = {"float32": "full", "float16": "left", "int8": "none"}
"""How markers are filled, by precision."""
_TITLES = {PHOTO: "a photo", STREAM: "a frame of a stream", PAGE: "the same in a browser"}
_HEADROOM = 1.08
"""Height of the axis of scores by the largest one, so that its marker is not cut off."""


def pareto(result: Mapping[str, Any]) -> bytes:
    """Draw the score over the time of an answer, as PNG, with a panel for each kind of use.

    A line joins what nothing beats among the cases of the material; precision fills the markers.
    Scores start at 0; time is logarithmic. `paper`, which has no score, is a line at its time.
    The result is that of `measure.measure`.
    """
    rows = [row for row in result["rows"] if row["kind"] in _TITLES]
    most = max(row["threads"] for row in rows)
    rows = [row for row in rows if row["threads"] == most]
    models = list(dict.fromkeys(row["model"] for row in rows if row["model"] != PAPER))
    tones = {model: TONES[index % len(TONES)] for index, model in enumerate(models)}
    titles = {
        kind: title for kind, title in _TITLES.items() if any(r["kind"] == kind for r in rows)
    }
    figure = Figure(
        figsize=(4.75 * len(titles), 4.4), dpi=DPI, facecolor=WHITE, layout="constrained"
    )
    panels = figure.subplots(1, len(titles), squeeze=False)[0]
    for axes, (kind, title) in zip(panels, titles.items(), strict=True):
        _panel(axes, [row for row in rows if row["kind"] == kind], tones)
        axes.set_title(title, color=INK, fontsize=10)
    points: dict[str, Any] = {"linestyle": "none", "markersize": 7}
    handles = [
        *(Line2D([], [], **points, marker="o", color=t, label=m) for m, t in tones.items()),
        *(
            Line2D([], [], **points, marker=shape, color=INK, label=name)
            for name, shape in _MARKERS.items()
            if name in ASKED[PHOTO]
        ),
        *(
            Line2D([], [], **points, marker="o", color=INK, fillstyle=filled, label=name)
            for name, filled in _FILLED.items()
        ),
        Line2D([], [], color=INK, linestyle=":", label=f"30 a second ({FRAME_MS:.1f} ms)"),
        Line2D([], [], color=INK, linestyle="--", label="paper, untrained"),
    ]
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=6,
        fontsize=8,
        frameon=False,
        labelcolor=INK,
    )
    return to_png(figure)


def _panel(axes: Axes, rows: Sequence[Mapping[str, Any]], tones: Mapping[str, str]) -> None:
    """Draw every case as a marker, and the Pareto front of the material as a stepped line."""
    known = [row for row in rows if row["model"] != PAPER]
    points = [(row["ms"], row["score"]) for row in known if row["asked"] == "material"]
    axes.step(*zip(*front(points), strict=True), where="post", color=INK, linewidth=0.9, alpha=0.5)
    for row in known:
        axes.plot(
            row["ms"],
            row["score"],
            linestyle="none",
            marker=_MARKERS[row["asked"]],
            markersize=7,
            fillstyle=_FILLED[row["precision"]],
            color=tones[row["model"]],
        )
    for row in rows:
        if row["model"] == PAPER and row["asked"] == "material":
            axes.axvline(row["ms"], color=INK, linewidth=0.8, linestyle="--", alpha=0.7)
    axes.axvline(FRAME_MS, color=INK, linewidth=0.8, linestyle=":", alpha=0.7)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("ms, median (logarithmic)", fontsize=8)
    axes.set_ylabel("score (error ÷ chance)", fontsize=8)
    axes.margins(0.08)
    # From 0, or a small difference would look like a large one.
    axes.set_ylim(0, _HEADROOM * max(row["score"] for row in known))
    dress(axes)
