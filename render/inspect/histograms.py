"""Histograms of all random quantities of a corpus, each beside the law that it was drawn from.

A law is given by its distribution function. The line shows the expected count of each bar; p is the
p-value of the Kolmogorov–Smirnov test. A page has a dozen tests, so p is red only below 0.001.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from scipy import stats

from lime_keras.optics import colour, shininess
from lime_keras.optics.material_law import AMBIENT

from ..scene.lights import MEAN_RADIANCE
from ..scene.sampling import FILL, OFF_AXIS

_DPI = 100
_PAPER, _INK, _FAINT, _BAR, _LAW, _ALARM = (
    "#ffffff",
    "#1d2430",
    "#d5dae1",
    "#7fa6d6",
    "#d1781f",
    "#c2232b",
)
_BARS = 24
_SUSPICIOUS = 1e-3
_LABELLED = 40
"""Largest number of shapes or lights whose names are written; more would not be legible."""
_ACROSS = 4

Law = Callable[[np.ndarray], np.ndarray]
"""Distribution function of a quantity: share of the values at or below each argument."""


@dataclass(frozen=True)
class Panel:
    """The panel of one quantity.

    Attributes:
        name: name of the quantity.
        title: title above the panel.
        edges: first and last edge of the bars, or all edges; by default the range of the values.
        law: law that the quantity was drawn from, if it is known.
        exact: whether the values follow the law exactly, so that a test is fair. Other values were
            measured from the mask, or some were rejected; then the line is only a guide to the eye.
        colour: colour of the bars.
        decades: whether log10 of the values is drawn.
    """

    name: str
    title: str
    edges: tuple[float, ...] | None = None
    law: Law | None = None
    exact: bool = True
    colour: str = _BAR
    decades: bool = False


def _uniform(low: float, high: float) -> Law:
    """Return the law of the uniform distribution between two values."""
    return lambda value: np.clip((value - low) / (high - low), 0, 1)


def _yuv(channel: int) -> Law:
    """Return the law of Y, U or V of colours that are uniform in the RGB cube.

    Colours drawn uniformly in YUV are rejected outside this cube; the transform is linear, so they
    are uniform inside it.
    """
    steps = (np.arange(40) + 0.5) / 40
    cube = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    values = np.sort(colour.rgb_to_yuv(cube)[:, channel])
    shares = (np.arange(len(values)) + 0.5) / len(values)
    return lambda value: np.interp(value, values, shares)


def _shift(value: np.ndarray) -> np.ndarray:
    """Evaluate the law of the object's shift in the frame.

    The shift is uniform in the free space that the object leaves; the object's size is uniform too.
    """
    slack = (1 - np.linspace(*FILL, 201)) / 2
    return np.mean(_uniform(-1, 1)(np.asarray(value)[..., None] / slack), axis=-1)


_ANGLE = math.degrees(OFF_AXIS)
_PANELS = (
    Panel("red", "m_d, red", (0, 1), _uniform(0, 1), colour="#d98a8a"),
    Panel("green", "m_d, green", (0, 1), _uniform(0, 1), colour="#8abf8f"),
    Panel("blue", "m_d, blue", (0, 1), _uniform(0, 1), colour="#8aa0d9"),
    Panel("specular_albedo", "m_s", (0, 1), _uniform(0, 1)),
    Panel("y", "m_d, Y", (0, 1), _yuv(0)),
    Panel("u", "m_d, U", (-0.44, 0.44), _yuv(1)),
    Panel("v", "m_d, V", (-0.62, 0.62), _yuv(2)),
    Panel("ambient", "m_a", AMBIENT, _uniform(*AMBIENT)),
    Panel(
        "log_exponent",
        "log10 s, in the bins",
        tuple(shininess.LOG_EDGES),
        _uniform(shininess.LOG_LOW, shininess.LOG_HIGH),
    ),
    Panel("coverage", "coverage", (0, 1)),
    Panel("fill", "object's longer side / frame", (0.4, 1), _uniform(*FILL), exact=False),
    Panel("field_of_view", "field of view of the crop, °"),
    Panel("shift_across", "object's centre / frame, left to right", None, _shift, exact=False),
    Panel("shift_up", "object's centre / frame, down to up", None, _shift, exact=False),
    Panel(
        "off_axis_across",
        "object off the photo's axis, left to right, °",
        None,
        _uniform(-_ANGLE, _ANGLE),
        exact=False,
    ),
    Panel(
        "off_axis_up",
        "object off the photo's axis, down to up, °",
        None,
        _uniform(-_ANGLE, _ANGLE),
        exact=False,
    ),
    Panel("azimuth", "strongest light, azimuth, ° (0: camera, 90: right)", (-180, 180)),
    Panel("elevation", "strongest light, elevation, °", (-90, 90)),
    Panel("level", "mean sRGB level of the object *", (0, 1)),
    Panel("clipped", "share of the object clipped *", (0, 1)),
    Panel("diffuse_shading_mean", "mean of D, log10 *", decades=True),
    Panel("specular_shading_mean", "mean of S, log10 *", decades=True),
    Panel("mirror_mean", "mean of M, log10 *", decades=True),
    Panel("mean_radiance", "mean radiance of the environment"),
    Panel("diffuse_shading_max", "maximum of D, log10 *", decades=True),
    Panel("specular_shading_max", "maximum of S, log10 *", decades=True),
    Panel("mirror_max", "maximum of M, log10 *", decades=True),
)


def draw(
    columns: Mapping[str, np.ndarray],
    uses: Mapping[str, Mapping[str, int]],
    pictured: int,
    title: str,
) -> Figure:
    """Draw a page with a panel for each quantity, for the albedos, the shapes and the lights.

    Args:
        columns: values `(N,)` by name of the quantity.
        uses: number of uses of each shape and each light, by kind and name.
        pictured: number of examples in which the quantities marked * were measured.
        title: name of the corpus and the split.
    """
    down = -(-(len(_PANELS) + 1) // _ACROSS)
    figure = Figure(
        figsize=(16, 2.3 * down + 4.6),
        dpi=_DPI,
        facecolor=_PAPER,
        layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08),
    )
    grid = figure.add_gridspec(down + 1, _ACROSS, height_ratios=[1.0] * down + [1.5])
    count = len(columns["red"])
    figure.suptitle(
        f"{title}: {count} examples ({pictured} for what is marked *). Line: the law that it was "
        "drawn from, dotted ± 2 σ.  p: Kolmogorov–Smirnov",
        color=_INK,
        fontsize=13,
    )
    for position, panel in enumerate(_PANELS):
        axes = figure.add_subplot(grid[divmod(position, _ACROSS)])
        _dress(axes)
        _histogram(axes, panel, np.asarray(columns.get(panel.name, ())))
        if panel.name == "mean_radiance":
            axes.locator_params(axis="x", nbins=5)
            axes.axvline(MEAN_RADIANCE, color=_LAW, linewidth=1.5)
    axes = figure.add_subplot(grid[divmod(len(_PANELS), _ACROSS)])
    _dress(axes)
    _albedos(axes, columns)
    half = _ACROSS // 2
    for (kind, counts), place in zip(
        uses.items(), (grid[down, :half], grid[down, half:]), strict=True
    ):
        axes = figure.add_subplot(place)
        _dress(axes)
        _names(axes, kind, counts)
    return figure


def _histogram(axes: Axes, panel: Panel, values: np.ndarray) -> None:
    if panel.decades:
        values = np.log10(values[values > 0])
    title, alarming = panel.title, False
    if len(values):
        edges = _edges(panel, values)
        inside = values[(values >= edges[0]) & (values <= edges[-1])]
        counts, _ = np.histogram(inside, edges)
        axes.stairs(counts, edges, fill=True, color=panel.colour)
        if panel.law is not None:
            _expectation(axes, np.diff(panel.law(edges)), len(values), edges)
        if panel.law is not None and panel.exact:
            # The stub expects a law of single numbers, but SciPy passes all values at once.
            p = float(stats.kstest(values, panel.law).pvalue)  # type: ignore[arg-type]
            title, alarming = f"{title}    p = {p:.2g}", p < _SUSPICIOUS
        if len(inside) < len(values):
            title, alarming = f"{title}    {len(values) - len(inside)} outside", True
        if panel.name == "log_exponent":
            _write_counts(axes, counts, edges)
        axes.set_xlim(edges[0], edges[-1])
    axes.set_ylim(bottom=0)
    ink, weight = (_ALARM, "bold") if alarming else (_INK, "normal")
    axes.set_title(title, fontsize=10, color=ink, fontweight=weight)


def _edges(panel: Panel, values: np.ndarray) -> np.ndarray:
    """Return the edges of the bars; more values give more bars."""
    if panel.edges is not None and len(panel.edges) > 2:
        return np.array(panel.edges)
    low, high = panel.edges or (values.min(), values.max())
    if low == high:
        low, high = low - 0.5, high + 0.5
    # Rounded to float32, numbers may lie just beyond the ends of their law.
    slack = 1e-6 * (high - low)
    bars = int(np.clip(math.sqrt(len(values)), 8, _BARS))
    return np.linspace(low - slack, high + slack, bars + 1)


def _expectation(axes: Axes, shares: np.ndarray, count: int, edges: np.ndarray) -> None:
    """Draw the expected counts of a law, and dotted lines two standard deviations away."""
    expected = count * shares
    deviation = 2 * np.sqrt(count * shares * (1 - shares))
    axes.stairs(expected, edges, baseline=None, color=_LAW, linewidth=1.6)
    for bound in (expected - deviation, expected + deviation):
        axes.stairs(np.maximum(bound, 0), edges, baseline=None, color=_LAW, linewidth=1.1, ls=":")


def _write_counts(axes: Axes, counts: np.ndarray, edges: np.ndarray) -> None:
    axes.set_xticks(edges, [f"{edge:g}" for edge in edges])
    for count, left, right in zip(counts, edges, edges[1:], strict=False):
        axes.text(
            (left + right) / 2,
            0.04,
            f"{count}",
            transform=axes.get_xaxis_transform(),
            ha="center",
            fontsize=8,
            color=_INK,
        )


def _albedos(axes: Axes, columns: Mapping[str, np.ndarray]) -> None:
    """Draw the colours of all m_d, each at its U and V."""
    rgb = np.stack([columns[name] for name in ("red", "green", "blue")], axis=-1)
    tones = np.clip(colour.linear_to_srgb(np.clip(rgb, 0, 1)), 0, 1)
    size = float(np.clip(4000 / len(rgb), 1, 20))
    axes.scatter(columns["u"], columns["v"], c=tones, s=size, linewidths=0)
    axes.set(xlim=(-0.46, 0.46), ylim=(-0.64, 0.64))
    axes.set_title("m_d at its U (across) and V (up)", fontsize=10, color=_INK)


def _names(axes: Axes, kind: str, counts: Mapping[str, int]) -> None:
    """Draw the number of uses of each shape or light, in falling order."""
    ranked = sorted(counts.items(), key=lambda item: -item[1])
    heights = [number for _, number in ranked]
    axes.bar(range(len(ranked)), heights, width=0.85, color=_BAR)
    axes.axhline(float(np.mean(heights)), color=_LAW, linewidth=1.5)
    unused = heights.count(0)
    axes.set_title(f"uses of {len(ranked)} {kind}, {unused} unused", fontsize=10, color=_INK)
    axes.set_xlim(-0.7, len(ranked) - 0.3)
    if len(ranked) <= _LABELLED:
        names = [name if len(name) <= 24 else f"{name[:23]}…" for name, _ in ranked]
        axes.set_xticks(range(len(ranked)), names, rotation=90, fontsize=7.5)
    else:
        axes.set_xticks([])


def _dress(axes: Axes) -> None:
    """Style the axes: small labels, faint spines at the left and the bottom only."""
    axes.tick_params(colors=_INK, labelsize=8)
    for name, spine in axes.spines.items():
        spine.set_color(_FAINT)
        spine.set_visible(name in ("left", "bottom"))
