"""`live_adam`: `live` whose S and encoders learn by Adam, as the paper's, at half of the rates.

    lime-train --recipe live_adam --data DATA --out runs/live-adam --reuse runs/live

The masks are those of `live`, and M is learnt by Adam there, too. Some 9 hours of one core, or 5
with --reuse. 20 GB of disk.
Scores: not trained yet.
"""

import dataclasses

from . import live

RECIPE = dataclasses.replace(
    live.RECIPE,
    trainings=live.RECIPE.trainings
    | {
        name: dataclasses.replace(
            live.RECIPE.trainings[name],
            optimizer="adam",
            rate=live.RECIPE.trainings[name].rate / 2,
        )
        for name in ("light", "material")
    },
)
