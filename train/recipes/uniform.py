"""`uniform`, for the paper's materials: as `live`, but m_s uniform from 0 to 1, by Muon.

    lime-train --recipe uniform --data DATA --out runs/uniform --reuse runs/live

Some 4 hours on two cores as `live`, or half an hour with --reuse of its run: only the encoders
differ. 20 GB of disk.
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
        "material": dataclasses.replace(shared.MATERIAL, materials=("uniform",)),
    },
    validation=dataclasses.replace(shared.VALIDATION, materials="uniform"),
    packages=shared.CUTOUTS,
)
