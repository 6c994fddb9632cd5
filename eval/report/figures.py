"""Matplotlib figures of the report as PNG: confusion matrices and reliability.

They are drawn without pyplot's global state.
"""

import io
import math
from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from lime_keras.optics import shininess

from ..accuracy import calibration

DPI = 150  # resolution of the figures in pixels per inch
WHITE, INK, FAINT, ACCENT = "#ffffff", "#1d2430", "#d5dae1", "#1f63b0"
"""Colours of the page: background, text, faint lines, and the accent of data and full shares."""
TONES = ("#3b82c4", "#e07b39", "#4a9d5b", "#b455a0", "#8a6d3b", "#c2434a", "#3fa7a7", "#7a6fd0")
"""Colours of the series in a figure."""


def confusions(matrices: Mapping[str, np.ndarray]) -> bytes:
    """Draw the paper's Figure 7 as PNG: confusion matrices `(8, 8)` of counts, by title.

    Each row is divided by its sum; rows without examples stay empty.
    """
    across = min(3, len(matrices))
    down = math.ceil(len(matrices) / across)
    size = (4.9 * across + 0.5, 4.9 * down)
    figure = Figure(figsize=size, dpi=DPI, facecolor=WHITE, layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for axes, (title, matrix) in zip(panels, matrices.items(), strict=False):
        _confusion(axes, matrix)
        axes.set_title(title, color=INK, fontsize=10)
    for axes in panels[len(matrices) :]:
        axes.set_axis_off()
    return to_png(figure)


def reliability(rows: Mapping[str, np.ndarray]) -> bytes:
    """Draw the share of correct bins by confidence as PNG, for rows with `bin_probabilities`."""
    is_right = rows["bin_distance"] == 0
    count, confidence, right = calibration.reliability(rows["bin_probabilities"], is_right)
    figure = Figure(figsize=(5.4, 4.9), dpi=DPI, facecolor=WHITE, layout="constrained")
    curve, counts = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1))
    for axes in (curve, counts):
        dress(axes)
    curve.plot([0, 1], [0, 1], color=INK, linewidth=0.8, alpha=0.6)
    known = count > 0
    # 95 % interval of a share of n examples, by the normal approximation.
    spread = 1.96 * np.sqrt(right * (1 - right) / np.maximum(count, 1))
    shown = (values[known] for values in (confidence, right, spread))
    curve.errorbar(*shown, fmt="o-", color=ACCENT, markersize=4, linewidth=1.2)
    curve.set(xlim=(0, 1), ylim=(0, 1), ylabel="share in the right bin")
    centres = (np.arange(calibration.BINS) + 0.5) / calibration.BINS
    counts.bar(centres, count, width=0.9 / calibration.BINS, color=ACCENT, alpha=0.6)
    counts.set(xlabel="probability of the winning bin", ylabel="images")
    return to_png(figure)


def dress(axes: Axes) -> None:
    """Give the axes the colours of the page."""
    axes.set_facecolor(WHITE)
    axes.tick_params(which="both", colors=INK, labelsize=8)
    axes.xaxis.label.set_color(INK)
    axes.yaxis.label.set_color(INK)
    for spine in axes.spines.values():
        spine.set_color(FAINT)


def to_png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def _confusion(axes: Axes, matrix: np.ndarray) -> None:
    counts = matrix.sum(axis=1, keepdims=True)
    shares = matrix / np.maximum(counts, 1)
    dress(axes)
    tones = LinearSegmentedColormap.from_list("shares", [WHITE, ACCENT])
    axes.imshow(shares, cmap=tones, vmin=0, vmax=1)
    labels = [shininess.bin_label(k).removeprefix("s ") for k in range(shininess.BIN_COUNT)]
    axes.set_xticks(range(len(labels)), labels, rotation=40, ha="right")
    axes.set_yticks(
        range(len(labels)),
        [f"{label} (n={n})" for label, n in zip(labels, counts[:, 0], strict=True)],
    )
    axes.set_xlabel("estimated exponent's bin")
    axes.set_ylabel("true exponent")
    for true, found in np.ndindex(matrix.shape):
        share = shares[true, found]
        ink = WHITE if share > 0.65 else INK
        text = f"{100 * share:.0f}" if matrix[true, found] else "·"
        axes.text(found, true, text, ha="center", va="center", color=ink, fontsize=9)
