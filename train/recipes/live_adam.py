"""`live_adam`: `live` whose S and encoders learn by Adam, as the paper's, at half of the rates.

    lime-train --recipe live_adam --data DATA --out runs/live-adam --reuse runs/live

The masks are those of `live`, and M is learnt by Adam there, too. Some 9 hours of one core, or 5
with --reuse. 20 GB of disk.
Scores: not trained yet.
"""

import dataclasses

from . import live

_BY_MUON = dict(live.RECIPE.trainings)

RECIPE = dataclasses.replace(
    live.RECIPE,
    trainings=_BY_MUON
    | {
        name: dataclasses.replace(_BY_MUON[name], optimizer="adam", rate=_BY_MUON[name].rate / 2)
        for name in ("light", "material")
    },
)
