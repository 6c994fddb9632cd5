"""How much work goes into an example's layers.

Every number here is a knob of the trade between exactness and time; `benchmarks/quality.py` draws
it, and docs/decisions.md says why the fast ones are what they are.
"""

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Quality:
    """Sampling of the pixels and of the light.

    Attributes:
        subsamples: samples across a pixel.
        refined: samples across a rough pixel, for coverage, D and M.
        rough_above: variance of a pixel's mirror directions above which it is rough; edges always
            are.
        cells: evaluations of S across a pixel whose mirror directions spread too far for the lobe.
        lobe_rough_above: variance of the mirror directions times (s + 2), above which they do.
        split_above: a light is split while its share of the energy times (extent / lobe width)²
            exceeds this.
        finest: rows of the map that lights S, a power of two; of a smaller map, the power below
            its own.
        irradiance_rows: rows of the table that D is looked up in.
        negligible: value of the lobe below which a light is passed over.
        precision: of the sums.
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
        irradiance_rows=64,
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
        irradiance_rows=128,
        negligible=1e-10,
        precision="float64",
    ),
}
"""`fast` renders corpora; `reference` is converged, and many times slower."""

FAST = QUALITIES["fast"]
