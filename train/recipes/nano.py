"""`nano`, where time counts: 64 pixels, of the scenes of `live`, averaged, by Muon.

    make weights NAME=nano DATA=DATA
    lime-train --recipe nano --data DATA --out runs/nano --reuse runs/live    # not shipped

SegmentationNet and the encoders of `live`, as it comes with the package, are trained on at 64
pixels; S and M, which are half as wide, from nothing. Some 2.5 hours of one core, or 1.5 with
--reuse of a run of `live`, which has the corpora (estimated from rates, see
docs/how-to/recipes.md). 15 GB of disk.
Scores: not trained yet. The set of this name that comes with the package is of before there were
recipes (lime_keras/pretrained/README.md).
"""

import dataclasses

from . import shared
from .recipe import Recipe

RECIPE = Recipe(
    preset="nano",
    corpora={name: shared.CORPORA[name] for name in shared.OF_128},
    trainings={
        "mask": dataclasses.replace(
            shared.MASKS["mask-128"], start_from="live", size=None, preset=None
        ),
        "light": dataclasses.replace(shared.LIGHT_128, start_from="mask", size=None, preset=None),
        "material": dataclasses.replace(shared.MATERIAL, materials=("natural",)),
        "mirror": dataclasses.replace(shared.MIRROR, materials=("natural",)),
    },
    validation=dataclasses.replace(shared.VALIDATION, size=64),
    packages=shared.CUTOUTS,
)
