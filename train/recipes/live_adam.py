"""`live` by Adam, as the paper trains, at half of the rates; all else is that of `live`.

    lime-train --recipe live_adam --data DATA --out runs/live-adam --reuse runs/live

Some 4 hours on two cores, or 3 with --reuse, which takes the corpora over. 20 GB of disk.
Scores: not trained yet.
"""

from . import live

RECIPE = live.RECIPE.by("adam", 0.5)
