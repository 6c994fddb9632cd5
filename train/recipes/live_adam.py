"""`live_adam`: `live` whose S and encoders learn by Adam, as the paper's, at half of the rates.

    lime-train --recipe live_adam --data DATA --out runs/live-adam

The mask and M are those of `live`, as it comes with the package, where Adam trains M, too. S and
the encoders learn from nothing, of the scenes of `live` and for as many batches. 15 GB of disk.
Scores: not trained to its end. With its S, and its encoders for a quarter of the batches: right bin
22.0 % (or neighbouring 53.3 %), log10 s 0.633, m_d 0.093, m_s 0.057, S 0.778; by Muon, as long,
24.5 % (56.4 %), 0.573, 0.090, 0.056, 0.758 (docs/lab/training.md).
"""

import dataclasses

from . import live, shared
from .recipe import Recipe

_BY_MUON = live.RECIPE.trainings

RECIPE = Recipe(
    preset="live",
    corpora={name: shared.CORPORA[name] for name in shared.OF_128},
    trainings={
        "light": dataclasses.replace(
            _BY_MUON["light"],
            stages=("specular",),
            rate=1e-3,
            optimizer="adam",
            start_from="live",
            options=("--fresh", "specular", "exponent", "albedo"),
        ),
        "material": dataclasses.replace(_BY_MUON["material"], rate=1e-3, optimizer="adam"),
    },
    validation=shared.VALIDATION,
)
