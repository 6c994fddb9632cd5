"""`live`, for cameras: 128 pixels, materials as common objects have them, by Muon.

    make weights NAME=live DATA=DATA
    lime-train --recipe live --data DATA --out runs/live        # the same, but for `make ship`

Some 4 hours on two cores: 1.2 render, 1.3 masks, 1 S and M, 0.4 the encoders (estimated from rates,
see docs/how-to/recipes.md). 20 GB of disk.
Scores: not trained yet. The set of this name that comes with the package is of before there were
recipes (lime_keras/pretrained/README.md).
"""

import dataclasses

from . import shared
from .recipe import Recipe

RECIPE = Recipe(
    preset="live",
    corpora=shared.CORPORA,
    trainings=shared.MASKS
    | {
        "light": shared.LIGHT_128,
        "material": dataclasses.replace(shared.MATERIAL, materials=("natural",)),
        "mirror": dataclasses.replace(shared.MIRROR, materials=("natural",)),
    },
    validation=shared.VALIDATION,
    packages=shared.CUTOUTS,
)
