"""Matplotlib figures as PNG: confusion matrix, reliability, relighting and albedos.

Each figure is drawn for a light or a dark page, without pyplot's global state.
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
from ..accuracy.labels import bin_label
from .themes import LIGHT, Theme

DPI = 150  # resolution of the figures in pixels per inch
TONES = ("#3b82c4", "#e07b39", "#4a9d5b", "#b455a0", "#8a6d3b", "#c2434a", "#3fa7a7", "#7a6fd0")
"""Colours of the series in a figure, distinguishable on white and on near-black."""


def confusion(matrix: np.ndarray, theme: Theme = LIGHT) -> bytes:
    """Draw a confusion matrix `(8, 8)` of counts as PNG, each row divided by its sum.

    Rows without examples stay empty.
    """
    figure = Figure(figsize=(5.4, 4.9), dpi=DPI, facecolor=theme.paper, layout="constrained")
    _confusion(figure.subplots(), matrix, theme)
    return to_png(figure)


def confusions(matrices: Mapping[str, np.ndarray], theme: Theme = LIGHT) -> bytes:
    """Draw the paper's Figure 7 as PNG: confusion matrices of several systems, by title."""
    across = min(3, len(matrices))
    down = math.ceil(len(matrices) / across)
    size = (4.9 * across, 4.7 * down)
    figure = Figure(figsize=size, dpi=DPI, facecolor=theme.paper, layout="constrained")
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for axes, (title, matrix) in zip(panels, matrices.items(), strict=False):
        _confusion(axes, matrix, theme)
        axes.set_title(title, color=theme.ink, fontsize=10)
    for axes in panels[len(matrices) :]:
        axes.set_axis_off()
    return to_png(figure)


def reliability(rows: Mapping[str, np.ndarray], theme: Theme = LIGHT) -> bytes | None:
    """Draw the share of correct bins by confidence as PNG; return None without probabilities.

    Args:
        rows: columns of `Evaluation.rows`.
        theme: colours of the page.
    """
    if "bin_probabilities" not in rows:
        return None
    is_right = rows["bin_distance"] == 0
    count, confidence, right = calibration.reliability(rows["bin_probabilities"], is_right)
    figure = Figure(figsize=(5.4, 4.9), dpi=DPI, facecolor=theme.paper, layout="constrained")
    curve, counts = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1))
    for axes in (curve, counts):
        dress(axes, theme)
    curve.plot([0, 1], [0, 1], color=theme.ink, linewidth=0.8, alpha=0.6)
    known = count > 0
    # 95 % interval of a share of n examples, by the normal approximation.
    spread = 1.96 * np.sqrt(right * (1 - right) / np.maximum(count, 1))
    curve.errorbar(
        confidence[known],
        right[known],
        spread[known],
        color=theme.accent,
        marker="o",
        markersize=4,
        linewidth=1.2,
    )
    curve.set(xlim=(0, 1), ylim=(0, 1), ylabel="share in the right bin")
    centres = (np.arange(calibration.BINS) + 0.5) / calibration.BINS
    counts.bar(centres, count, width=0.9 / calibration.BINS, color=theme.accent, alpha=0.6)
    counts.set(xlabel="probability of the winning bin", ylabel="images")
    return to_png(figure)


def relighting(rows: Mapping[str, np.ndarray], theme: Theme = LIGHT) -> bytes:
    """Draw as PNG the share of images whose relighting PSNR is at least x, under both lights.

    Args:
        rows: columns of `Evaluation.rows`.
        theme: colours of the page.
    """
    figure = Figure(figsize=(7.0, 4.9), dpi=DPI, facecolor=theme.paper, layout="constrained")
    axes = figure.subplots()
    dress(axes, theme)
    count = len(rows["relit"])
    share = 1 - np.arange(count) / count
    for column, style, light in (
        ("relit", "-", "photo's light"),
        ("relit_unseen", "--", "light not seen"),
    ):
        for prefix, tone, who in (
            ("", theme.accent, "estimated"),
            ("average_", "#8a93a1", "middle of all ranges"),
        ):
            sorted_psnr = np.sort(rows[prefix + column])
            axes.plot(sorted_psnr, share, style, color=tone, label=f"{who}, {light}")
    axes.set(xlabel="PSNR in dB, at least", ylabel="share of the images", ylim=(0, 1))
    axes.legend(fontsize=8, frameon=False, labelcolor=theme.ink)
    return to_png(figure)


def dress(axes: Axes, theme: Theme) -> None:
    """Give the axes the colours of the page."""
    axes.set_facecolor(theme.paper)
    axes.tick_params(which="both", colors=theme.ink, labelsize=8)
    axes.xaxis.label.set_color(theme.ink)
    axes.yaxis.label.set_color(theme.ink)
    for spine in axes.spines.values():
        spine.set_color(theme.faint)


def to_png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def _confusion(axes: Axes, matrix: np.ndarray, theme: Theme) -> None:
    counts = matrix.sum(axis=1, keepdims=True)
    shares = matrix / np.maximum(counts, 1)
    dress(axes, theme)
    tones = LinearSegmentedColormap.from_list("shares", [theme.paper, theme.accent])
    axes.imshow(shares, cmap=tones, vmin=0, vmax=1)
    labels = [bin_label(k).removeprefix("s ") for k in range(shininess.BIN_COUNT)]
    axes.set_xticks(range(len(labels)), labels, rotation=40, ha="right")
    axes.set_yticks(
        range(len(labels)),
        [f"{label} (n={n})" for label, n in zip(labels, counts[:, 0], strict=True)],
    )
    axes.set_xlabel("estimated exponent's bin")
    axes.set_ylabel("true exponent")
    for true, found in np.ndindex(matrix.shape):
        share = shares[true, found]
        ink = theme.paper if share > 0.65 else theme.ink
        text = f"{100 * share:.0f}" if matrix[true, found] else "·"
        axes.text(found, true, text, ha="center", va="center", color=ink, fontsize=9)


def albedos(rows: Mapping[str, np.ndarray], theme: Theme = LIGHT) -> bytes:
    """Draw estimated over true albedos as PNG: the channels of m_d in their colours, and m_s."""
    figure = Figure(figsize=(7.0, 3.7), dpi=DPI, facecolor=theme.paper, layout="constrained")
    left, right = figure.subplots(1, 2)
    size = float(np.clip(2000 / len(rows["bin"]), 3, 30))
    style = {"s": size, "alpha": 0.55, "linewidths": 0}
    for channel, tone in enumerate(("#d0454c", "#3f9a54", "#4a7fd0")):
        true, found = rows["diffuse_albedo"], rows["diffuse_found"]
        left.scatter(true[:, channel], found[:, channel], color=tone, **style)
    right.scatter(rows["specular_albedo"], rows["specular_found"], color="#8f7bd6", **style)
    for axes, title in ((left, "diffuse albedo (R, G, B)"), (right, "specular albedo")):
        dress(axes, theme)
        axes.plot([0, 1], [0, 1], color=theme.ink, linewidth=0.8, alpha=0.6)
        axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", xlabel="true", ylabel="estimated")
        axes.set_title(title, color=theme.ink, fontsize=10)
    return to_png(figure)
