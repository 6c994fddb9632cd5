"""`nano`, where time counts: 64 pixels, of the scenes of `live`, averaged, by Muon.

    lime-train --recipe nano --data DATA --out runs/nano --reuse runs/live

Some 3.5 hours on two cores, or 1 with --reuse of a run of `live` (estimated from rates, see
docs/how-to/recipes.md). 20 GB of disk.
Scores: not trained yet. The set of this name that comes with the package is of before there were
recipes (lime_keras/pretrained/README.md).
"""

import dataclasses

from . import shared
from .recipe import Recipe

RECIPE = Recipe(
    preset="nano",
    corpora=shared.CORPORA,
    trainings=shared.MASKS
    | {
        "mask": dataclasses.replace(
            shared.MASKS["mask-128"], start_from="mask-128", size=None, preset=None
        ),
        "light": dataclasses.replace(shared.LIGHT_128, start_from="mask", size=None, preset=None),
        "material": dataclasses.replace(shared.MATERIAL, materials=("natural",)),
        "mirror": dataclasses.replace(shared.MIRROR, materials=("natural",)),
    },
    validation=dataclasses.replace(shared.VALIDATION, size=64),
    packages=shared.CUTOUTS,
)
