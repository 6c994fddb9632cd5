"""`live`, for cameras: 128 pixels, materials as common objects have them, by Muon.

    make weights NAME=live DATA=DATA
    lime-train --recipe live --data DATA --out runs/live        # the same, but for `make ship`

Some 9 hours of one core: 1 rendering, 3 for the masks, 2.3 for S and M, 0.7 for the encoders, 1.6
for M once more. 20 GB of disk. The set of this name that comes with the package is its, of seed 0.

Scores on its validation scenes: mask IoU 92.9 %, right bin 27.2 % (or neighbouring 59.8 %),
log10 s 0.561, m_d 0.088, m_s 0.055, S 0.758, M 0.860. With seed 1 of the encoders 29.2 % (57.7 %),
0.561, 0.089, 0.057. `live` of before there were recipes, which had learnt from some of these
meshes: 89.6 %, 24.8 % (53.6 %), 0.598, 0.093, 0.054, 0.762, 0.842.

S, M and the encoders learnt in bfloat16, for which a processor needs AVX-512 BF16 or AMX; without,
set their `precision` to float32 in a recipe of your own.
"""

import dataclasses

from . import shared
from .recipe import Recipe

RECIPE = Recipe(
    preset="live",
    corpora=shared.CORPORA,
    trainings=shared.MASKS
    | {
        name: dataclasses.replace(training, precision="bfloat16")
        for name, training in {
            "light": shared.LIGHT_128,
            "material": dataclasses.replace(shared.MATERIAL, materials=("natural",)),
            "mirror": dataclasses.replace(shared.MIRROR, materials=("natural",)),
        }.items()
    },
    validation=shared.VALIDATION,
    packages=shared.CUTOUTS,
)
