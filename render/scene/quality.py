"""The qualities of rendering: settings that trade the exactness of the layers against time.

`benchmarks/quality.py` draws this trade; docs/lab/renderer.md gives the reasons for the
fast settings.
"""

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Quality:
    """Settings for the sampling of the pixels and of the light.

    Attributes:
        subsamples: samples across a pixel.
        refined: samples across a rough pixel, for coverage, D and M.
        rough_above: variance of a pixel's mirror directions above which the pixel is rough. Pixels
            at edges are always rough.
        cells: evaluations of S across a pixel whose mirror directions spread too far for the lobe.
        lobe_rough_above: limit of (s + 2) times the variance of the mirror directions; above it,
            they spread too far for the lobe.
        split_above: limit of a texel's share of the energy times (extent / lobe width)²; above it,
            the texel is split into four lights.
        finest: largest number of rows of the map that lights S, a power of two.
        irradiance_rows: rows of the table in which D is looked up, a power of two.
        negligible: value of the lobe below which a light is left out.
        precision: floating-point type of the sums.
    """

    subsamples: int
    refined: int
    rough_above: float
    cells: int
    lobe_rough_above: float
    split_above: float
    finest: int
    irradiance_rows: int
    negligible: float
    precision: Literal["float32", "float64"]


QUALITIES = {
    "fast": Quality(
        subsamples=3,
        refined=6,
        rough_above=math.radians(2.0) ** 2,
        cells=2,
        lobe_rough_above=0.3,
        split_above=5e-3,
        finest=256,
        irradiance_rows=128,
        negligible=1e-6,
        precision="float32",
    ),
    "reference": Quality(
        subsamples=9,
        refined=9,
        rough_above=0.0,
        cells=3,
        lobe_rough_above=0.0,
        split_above=1e-4,
        finest=512,
        irradiance_rows=256,
        negligible=1e-10,
        precision="float64",
    ),
}
"""Qualities by name: `fast` renders corpora; `reference` is converged, and many times slower."""

FAST = QUALITIES["fast"]
