"""The figure of the trade-off: latency against the score and each error, with the Pareto front."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from ..accuracy.measures import MEASURES
from ..report.figures import DPI, TONES, dress, to_png
from ..report.themes import LIGHT, Theme
from .cases import compares_runtimes
from .recommendation import FRAME_MS, front
from .runtimes import KERAS, ONNX, SAVED_MODEL

_MARKERS = {"float32": "o", "bfloat16": "s", "float16": "D", "int8": "v"}
_FILLS: dict[str, Any] = {ONNX: "full", SAVED_MODEL: "left", KERAS: "none"}
"""Fill style of a marker by runtime."""
_ACROSS = 3
_LEAST_HEIGHT = 1e-6
"""Least top of an axis of errors, for errors that are all 0."""
_HEADROOM = 1.08
"""Height of an axis of errors by the largest one, so that its marker is not cut off."""


def pareto(result: Mapping[str, Any], theme: Theme = LIGHT) -> bytes:
    """Draw the score and each scored error over the latency of one image, as PNG.

    A line joins the variants on the Pareto front. Errors start at 0; latency is logarithmic.

    Args:
        result: result of `measure.measure`; only its full cross is drawn (see `compares_runtimes`).
        theme: colours of the page.
    """
    rows = [row for row in result["rows"] if compares_runtimes(row, result["machine"]["cores"])]
    titles = {None: "score (error ÷ chance)"}
    titles |= {name: MEASURES[name].title for name in result["scored"]}
    down = math.ceil(len(titles) / _ACROSS)
    size = (4.0 * _ACROSS, 3.1 * down + 1.3)
    figure = Figure(figsize=size, dpi=DPI, facecolor=theme.paper, layout="constrained")
    panels = figure.subplots(down, _ACROSS, squeeze=False).ravel()
    models = list(dict.fromkeys(row["model"] for row in rows))
    tones = {model: TONES[index % len(TONES)] for index, model in enumerate(models)}
    for axes, (name, title) in zip(panels, titles.items(), strict=False):
        errors = [row["errors"][name] if name else row["score"] for row in rows]
        _panel(axes, rows, errors, tones, theme)
        axes.set_title(title, color=theme.ink, fontsize=10)
    for axes in panels[len(titles) :]:
        axes.set_axis_off()
    groups = _legend(tones, [row["precision"] for row in rows], theme)
    longest = max(map(len, groups))
    blank = Line2D([], [], linestyle="none", label=" ")
    figure.legend(
        # Legends are filled by columns.
        handles=[line for group in groups for line in group + [blank] * (longest - len(group))],
        loc="outside lower center",
        ncols=len(groups),
        fontsize=8,
        frameon=False,
        labelcolor=theme.ink,
    )
    return to_png(figure)


def _panel(
    axes: Axes,
    rows: Sequence[Mapping[str, Any]],
    errors: Sequence[float],
    tones: Mapping[str, str],
    theme: Theme,
) -> None:
    """Draw every variant as a marker, and the Pareto front as a stepped line."""
    points = [(row["latency_ms"], error) for row, error in zip(rows, errors, strict=True)]
    best = sorted(point for point, on in zip(points, front(points), strict=True) if on)
    axes.step(*zip(*best, strict=True), where="post", color=theme.ink, linewidth=0.9, alpha=0.5)
    for row, (latency, error) in zip(rows, points, strict=True):
        axes.plot(
            latency,
            error,
            linestyle="none",
            marker=_MARKERS[row["precision"]],
            markersize=7,
            fillstyle=_FILLS[row["runtime"]],
            color=tones[row["model"]],
            markerfacecoloralt=theme.paper,
        )
    axes.axvline(FRAME_MS, color=theme.ink, linewidth=0.8, linestyle=":", alpha=0.7)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("ms for one image, median (logarithmic)", fontsize=8)
    axes.margins(0.08)
    # From 0, or a small difference would look like a large one.
    axes.set_ylim(0, max(_HEADROOM * max(errors), _LEAST_HEIGHT))
    dress(axes, theme)


def _legend(
    tones: Mapping[str, str], precisions: Collection[str], theme: Theme
) -> list[list[Line2D]]:
    """Return the columns of the legend: models, precisions, runtimes, and lines."""
    points: dict[str, Any] = {"linestyle": "none", "color": theme.ink, "markersize": 7}
    shapes = {name: shape for name, shape in _MARKERS.items() if name in precisions}
    return [
        [
            Line2D([], [], **points | {"color": tone}, marker="o", label=model)
            for model, tone in tones.items()
        ],
        [Line2D([], [], **points, marker=shape, label=name) for name, shape in shapes.items()],
        [
            Line2D([], [], **points, marker="o", fillstyle=fill, label=runtime)
            for runtime, fill in _FILLS.items()
        ],
        [
            Line2D([], [], color=theme.ink, alpha=0.5, label="nothing beats these"),
            Line2D(
                [], [], color=theme.ink, linestyle=":", label=f"30 images/s ({FRAME_MS:.1f} ms)"
            ),
        ],
    ]
