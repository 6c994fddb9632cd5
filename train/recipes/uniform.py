"""`uniform`, for the paper's materials: as `live`, but m_s uniform from 0 to 1, by Muon.

    lime-train --recipe uniform --data DATA --out runs/uniform --reuse runs/live

SpecularNet reads the split of colours, too, which finds S better on renders, and loses highlights
of prints on photographs. Some 10 hours of one core as `live`, or 5 with --reuse of its run, which
has the corpora and masks. 20 GB of disk.
Scores: not trained yet. The set of this name that comes with the package is of before there were
recipes (lime_keras/pretrained/README.md).
"""

import dataclasses

from . import shared
from .recipe import Recipe

_SPLIT = ("--with", "dichromatic-shading")

RECIPE = Recipe(
    preset="live",
    corpora=shared.CORPORA,
    trainings=shared.MASKS
    | {
        "light": dataclasses.replace(shared.LIGHT_128, options=_SPLIT),
        "material": dataclasses.replace(shared.MATERIAL, materials=("uniform",), options=_SPLIT),
        "mirror": dataclasses.replace(shared.MIRROR, materials=("uniform",), options=_SPLIT),
    },
    validation=dataclasses.replace(shared.VALIDATION, materials="uniform"),
    packages=shared.CUTOUTS,
)
