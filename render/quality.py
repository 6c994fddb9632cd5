"""How much work goes into an example's layers.

Every number here is a knob of the trade between exactness and time; `benchmarks/quality.py` draws
it, and docs/decisions.md says why the fast ones are what they are.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Quality:
    """Sampling of the pixels and of the light.

    Attributes:
        subsamples: samples across a pixel, odd, for coverage, D and M.
        lobe_samples: evaluations of S across a pixel; a divisor of `subsamples`.
        split_above: a light is split while its share of the energy times (extent / lobe width)²
            exceeds this.
        finest: rows of the map that lights S, where the file has as many.
        irradiance_rows: rows of the table that D is looked up in.
        negligible: value of the lobe below which a light is passed over.
        precision: of the sums.
    """

    subsamples: int
    lobe_samples: int
    split_above: float
    finest: int
    irradiance_rows: int
    negligible: float
    precision: type[np.floating]


QUALITIES = {
    "fast": Quality(3, 1, 2e-3, 256, 32, 1e-6, np.float32),
    "reference": Quality(9, 3, 1e-4, 512, 128, 1e-10, np.float64),
}
"""`fast` renders corpora; `reference` is converged, and some hundred times slower."""

FAST = QUALITIES["fast"]
