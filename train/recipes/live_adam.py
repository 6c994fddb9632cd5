"""`live_adam`: `live` whose S and encoders learn by Adam, as the paper's, at half of the rates.

    lime-train --recipe live_adam --data DATA --out runs/live-adam

The mask and M are those of `live`, as it comes with the package, where Adam trains M, too. S and
the encoders learn from nothing, of the scenes of `live` and for as many batches. 15 GB of disk.
Scores on its validation scenes: right bin 25.8 % (or neighbouring 52.2 %), log10 s 0.582, m_d
0.088, m_s 0.055, S 0.778, M 0.864; `live` has 27.2 % (59.7 %), 0.561, 0.088, 0.055, 0.758, 0.860.
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
