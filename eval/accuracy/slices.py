"""The measures on parts of the test images, to show for which images a system is good or bad."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lime_keras.optics import shininess

from . import measures
from .labels import bin_label

SHOWN = (
    "mask_iou",
    "exponent_exact",
    "exponent_within_one",
    "log_exponent_mae",
    "diffuse_albedo_mae",
    "specular_albedo_mae",
    "relighting_psnr",
)
"""Names of the measures shown for each part."""

_QUARTERS = (
    ("coverage", "coverage", "{:.0%}"),
    ("light's contrast", "light_contrast", "{:,.0f}"),
    ("saturated", "saturated", "{:.1%}"),
)


@dataclass(frozen=True)
class Slice:
    """The measures on a part of the test images.

    Attributes:
        by: property by which the images are divided, such as "coverage".
        label: value or range of the property in this part.
        count: number of images in this part.
        value: measures by name: those of `SHOWN` that the system has.
        interval: 95 % bootstrap interval `[low, high]` of each measure, by name.
    """

    by: str
    label: str
    count: int
    value: dict[str, float]
    interval: dict[str, list[float]]


def slices(rows: Mapping[str, np.ndarray]) -> list[Slice]:
    """Divide an `Evaluation`'s rows by bin, coverage, light contrast, saturation, shape, light.

    Coverage, light contrast and saturation are continuous and are divided at their quartiles. Equal
    values stay together, so there may be fewer than four parts. No part is empty.
    """
    return [_slice(rows, *part) for part in _parts(rows) if part[-1].size]


def _parts(rows: Mapping[str, np.ndarray]) -> Iterator[tuple[str, str, np.ndarray]]:
    """Yield `by`, `label` and the positions of the images of each part; some may be empty."""
    for k in range(shininess.BIN_COUNT):
        yield "exponent", bin_label(k), np.flatnonzero(rows["bin"] == k)
    for title, name, style in _QUARTERS:
        yield from _quarters(title, rows[name], style)
    for name in ("shape", "light"):
        for value in np.unique(rows[name]):
            yield name, value.decode(), np.flatnonzero(rows[name] == value)


def _quarters(title: str, values: np.ndarray, style: str) -> Iterator[tuple[str, str, np.ndarray]]:
    """Yield the parts between the quartiles, labelled with their least and greatest value."""
    part = np.searchsorted(np.percentile(values, (25, 50, 75)), values, side="left")
    for quarter in range(4):
        chosen = np.flatnonzero(part == quarter)
        if chosen.size:
            ends = [style.format(end(values[chosen])) for end in (np.min, np.max)]
            yield title, " to ".join(dict.fromkeys(ends)), chosen


def _slice(rows: Mapping[str, np.ndarray], by: str, label: str, chosen: np.ndarray) -> Slice:
    part = {name: column[chosen] for name, column in rows.items()}
    value, interval = measures.values(part), measures.intervals(part)

    def shown(numbers: Mapping[str, Any]) -> dict[str, Any]:
        return {name: numbers[name] for name in SHOWN if name in numbers}

    return Slice(by, label, len(chosen), shown(value), shown(interval))
