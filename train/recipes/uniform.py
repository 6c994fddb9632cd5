"""`uniform`, for the paper's materials: as `live`, but m_s uniform from 0 to 1, by Muon.

    make weights NAME=uniform DATA=DATA
    lime-train --recipe uniform --data DATA --out runs/uniform --reuse runs/live    # not shipped

Its SpecularNet reads the split of colours, too, which finds S better on renders, and loses
highlights of prints on photographs; it learns from nothing. The mask is that of `live`, as it comes
with the package. The encoders and M begin with those of `live`; M learns for a third as long as
there. All of it learns in bfloat16, as S, M and the encoders of `live` do. Some 5 hours of one
core, or 4 with --reuse of a run of `live`, which has the corpora (estimated from rates, see
docs/how-to/recipes.md). 15 GB of disk.
Scores: not trained yet. The set of this name that comes with the package is of before there were
recipes (lime_keras/pretrained/README.md).
"""

import dataclasses

from . import shared
from .recipe import Recipe

_SPLIT = ("--with", "dichromatic-shading")

RECIPE = Recipe(
    preset="live",
    corpora={name: shared.CORPORA[name] for name in shared.OF_128},
    trainings={
        name: dataclasses.replace(training, precision="bfloat16", options=_SPLIT)
        for name, training in {
            "light": dataclasses.replace(shared.LIGHT_128, stages=("specular",), start_from="live"),
            "material": dataclasses.replace(shared.MATERIAL, materials=("uniform",)),
            "mirror": dataclasses.replace(
                shared.MIRROR, steps=2_000, photos=16_000, materials=("uniform",)
            ),
        }.items()
    },
    validation=dataclasses.replace(shared.VALIDATION, materials="uniform"),
)
