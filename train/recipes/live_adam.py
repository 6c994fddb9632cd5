"""`live` by Adam, as the paper trains, at half of the rates; all else is that of `live`.

    lime-train --recipe live_adam --data DATA --out runs/live-adam --reuse runs/live

HOURS
Scores: not trained yet.
"""

from . import live

RECIPE = live.RECIPE.by("adam", 0.5)
