"""Histograms of the lights that the law draws from a bank, beside the bank's photographed maps."""

from collections.abc import Callable, Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lime_keras.optics import environment
from lime_keras.synthesis import light_law, mixing
from lime_keras.synthesis.lights import LightBank

from ..scene.sampling import sample_light_rotation

_COUNT = 400
_BATCH = 16
_SEED = 0
_BARS = 20
_BRIGHTEST = 0.005
"""Part of the sphere whose share of the energy says how much the light is one of lamps."""
_PHOTOGRAPHED, _DRAWN, _INK = "#d1781f", "#7fa6d6", "#1d2430"

_MEASURES = {
    "contrast": ("contrast: log10 of 99th percentile / median", (0, 4.5)),
    "peak": ("peak: log10 of largest / mean", (0, 5.5)),
    "brightest": (f"share of the energy in the brightest {_BRIGHTEST:.1%} of the sphere", (0, 1)),
    "directed": ("directedness: |∫ E i di| / ∫ E di", (0, 1)),
    "front": ("share of the energy in front (z > 0 in camera space)", (0, 1)),
    "strongest": ("z of the direction of the strongest 11° texel", (-1, 1)),
}


def light_histograms(bank: LightBank, tell: Callable[[int, int], None]) -> Figure:
    """Draw how contrast and direction spread, among photographed maps and among drawn lights.

    Both are posed before the camera: the photographed maps as a corpus poses them. All maps of a
    bank without photographs stand in for them. There is no histogram of colours, because a light
    has one channel.

    Args:
        bank: the lights to draw from.
        tell: called with (done, total) as lights are drawn.
    """
    columns = _lights(bank, tell)
    figure = Figure(figsize=(15, 7), dpi=100, layout="constrained")
    for axes, (measure, (title, ends)) in zip(
        figure.subplots(2, 3).flat, _MEASURES.items(), strict=True
    ):
        for colour, (label, lights) in zip((_PHOTOGRAPHED, _DRAWN), columns, strict=True):
            values = np.array([light[measure] for light in lights])
            _histogram(axes, values, ends, colour, label)
        axes.set_title(title, fontsize=10, color=_INK)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def _lights(
    bank: LightBank, tell: Callable[[int, int], None]
) -> list[tuple[str, list[dict[str, float]]]]:
    """Return the name and the measures of the photographed maps, and of the drawn lights."""
    photographs = [k for k, kind in enumerate(bank.kinds) if kind == "photograph"]
    shown = photographs or list(range(len(bank.kinds)))
    rngs = [np.random.default_rng([_SEED, k]) for k in shown]
    posed = [
        measures(bank.map(k), sample_light_rotation(rng, bank.strong_direction[k]))
        for k, rng in zip(shown, rngs, strict=True)
    ]
    drawn: list[dict[str, float]] = []
    for batch in drawn_lights(bank, _COUNT, _SEED):
        drawn += [measures(*light) for light in zip(*batch, strict=True)]
        tell(len(drawn), _COUNT)
    name = "photographed maps" if photographs else "maps"
    return [(f"{len(shown)} {name}", posed), (f"{_COUNT} drawn lights", drawn)]


def drawn_lights(bank: LightBank, count: int, seed: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Draw lights from all maps of a bank, and yield them in batches.

    Yields:
        Linear radiance in the maps' frame, `(B, H, W)` float32, and rotations to camera space,
        `(B, 3, 3)`.
    """
    for first in range(0, count, _BATCH):
        places = range(first, min(first + _BATCH, count))
        rngs = [np.random.default_rng([seed, place]) for place in places]
        light = light_law.draw(rngs, bank, np.arange(len(bank.strong_direction)))
        yield mixing.mixed(bank.radiance, light), light.rotation


def measures(radiance: np.ndarray, rotation: np.ndarray) -> dict[str, float]:
    """Measure the contrast and the direction of a light.

    Args:
        radiance: linear radiance `(H, W)` in the map's frame, somewhere above 0; H is a multiple of
            16.
        rotation: rotation `(3, 3)` from the map's frame to camera space.
    """
    shares = environment.solid_angles(*radiance.shape) / (4 * np.pi)
    towards = environment.directions(*radiance.shape) @ np.asarray(rotation, float).T
    energy = radiance * shares
    order = np.argsort(radiance, axis=None)
    covered = np.cumsum(shares.flat[order])
    rising = radiance.flat[order]
    median, high = rising[np.searchsorted(covered, (0.5, 0.99))]
    dim = np.interp(1 - _BRIGHTEST, covered, np.cumsum(energy.flat[order]))
    total = energy.sum()
    rows = len(radiance) // 16
    coarse = energy.reshape(16, rows, 32, -1).sum(axis=(1, 3))
    moments = (energy[..., None] * towards).reshape(16, rows, 32, -1, 3).sum(axis=(1, 3))
    strongest = moments[np.unravel_index(np.argmax(coarse), coarse.shape)]
    least = 1e-6 * rising[-1]
    return {
        "contrast": float(np.log10(max(high, least) / max(median, least))),
        "peak": float(np.log10(rising[-1] / total)),
        "brightest": float(1 - dim / total),
        "directed": float(np.linalg.norm((energy[..., None] * towards).sum(axis=(0, 1))) / total),
        "front": float(energy[towards[..., 2] > 0].sum() / total),
        "strongest": float(strongest[2] / np.linalg.norm(strongest)),
    }


def _histogram(
    axes: Axes, values: np.ndarray, ends: tuple[float, float], colour: str, label: str
) -> None:
    """Draw the share of the values in each bar; values beyond the ends count in the last bars."""
    edges = np.linspace(*ends, _BARS + 1)
    counts, _ = np.histogram(np.clip(values, *ends), edges)
    style = {"fill": True, "alpha": 0.55} if colour == _DRAWN else {"linewidth": 2}
    axes.stairs(counts / len(values), edges, color=colour, label=label, **style)
    axes.tick_params(labelsize=8)
