"""`uniform`, for the paper's materials: as `live`, but m_s uniform from 0 to 1, by Muon.

    make weights NAME=uniform DATA=DATA
    lime-train --recipe uniform --data DATA --out runs/uniform --reuse runs/live

Its SpecularNet reads the split of colours, too, which finds S better on renders, and loses
highlights of prints on photographs; it learns from nothing. The mask is that of `live`, as it comes
with the package. The encoders and M begin with those of `live`; M learns for a third as long as
there. All of it learns in bfloat16, as S, M and the encoders of `live` do. 3.4 hours of two
cores with AVX-512, 1.1 of them rendering, which --reuse of a run of `live` saves; 15 GB of disk.
The set of this name that comes with the package is its, of seed 0.

Scores on its validation scenes: mask IoU 92.9 %, right bin 34.7 % (or neighbouring
67.5 %), log10 s 0.481, m_d 0.097, m_s 0.169, S 0.579, M 0.853. With seed 1 of the encoders
34.8 % (66.7 %), 0.491, 0.097, 0.169. `uniform` of before there were recipes, which had learnt
from some of these meshes: 90.2 %, 35.8 % (67.7 %), 0.506, 0.097, 0.175, 0.611, 0.840.
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
