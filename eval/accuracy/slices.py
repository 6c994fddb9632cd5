"""The measures on parts of the test images, to show for which images a system is good or bad."""

from collections.abc import Iterator, Mapping

import numpy as np

from lime_keras.optics import shininess

from . import measures

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


def rows(columns: Mapping[str, np.ndarray]) -> list[tuple[str, ...]]:
    """Return the cells of a header, and of a row for each part of an `Evaluation`'s rows.

    The parts are by bin, coverage, light contrast, saturation, shape and light. Coverage, light
    contrast and saturation are continuous and are divided at their quartiles. Equal values stay
    together, so there may be fewer than four parts. No part is empty.

    Returns:
        The part, the number of its images, and with their intervals the measures of `SHOWN` that
        the system has.
    """
    measured = measures.values(columns)
    shown = {name: measures.MEASURES[name] for name in SHOWN if name in measured}
    out = [("Part", "images", *(measure.short for measure in shown.values()))]
    for by, label, chosen in _parts(columns):
        if not chosen.size:
            continue
        part = {name: column[chosen] for name, column in columns.items()}
        value, interval = measures.values(part), measures.ends(measures.resampled(part))
        cells = (
            # Every resample of one image is that image.
            m.unit.with_interval(value[name], interval[name])
            if chosen.size > 1
            else m.unit.number(value[name])
            for name, m in shown.items()
        )
        out.append((f"{by}: {label}", str(chosen.size), *cells))
    return out


def _parts(columns: Mapping[str, np.ndarray]) -> Iterator[tuple[str, str, np.ndarray]]:
    """Yield `by`, `label` and the positions of the images of each part; some may be empty."""
    for k in range(shininess.BIN_COUNT):
        yield "exponent", shininess.bin_label(k), np.flatnonzero(columns["bin"] == k)
    for title, name, style in _QUARTERS:
        yield from _quarters(title, columns[name], style)
    for name in ("shape", "light"):
        for value in np.unique(columns[name]):
            yield name, value.decode(), np.flatnonzero(columns[name] == value)


def _quarters(title: str, values: np.ndarray, style: str) -> Iterator[tuple[str, str, np.ndarray]]:
    """Yield the parts between the quartiles, labelled with their least and greatest value."""
    part = np.searchsorted(np.percentile(values, (25, 50, 75)), values, side="left")
    for quarter in range(4):
        chosen = np.flatnonzero(part == quarter)
        if chosen.size:
            ends = [style.format(end(values[chosen])) for end in (np.min, np.max)]
            yield title, " to ".join(dict.fromkeys(ends)), chosen
