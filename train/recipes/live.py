"""`live`, for cameras: 128 pixels, materials as common objects have them, by Muon.

    make weights NAME=live DATA=DATA
    lime-train --recipe live --data DATA --out runs/live        # the same, but for `make ship`

Some 10 hours of one core: 1 rendering, 4 for the masks, 2.4 for S and M, 1 for the encoders, 1.5
for M once more (each step timed on one core, beside other work on the second). 20 GB of disk.

Scores on its validation scenes: mask IoU 92.9 %, right bin 27.2 % (or neighbouring 59.8 %),
log10 s 0.561, m_d 0.088, m_s 0.055, S 0.758, M 0.860. The set of this name that comes with the
package is of before there were recipes (lime_keras/pretrained/README.md), and has on them 89.6 %,
24.8 % (53.6 %), 0.598, 0.093, 0.054, 0.762, 0.842; some of their meshes were in its training.
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
