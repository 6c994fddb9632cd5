"""`nano`, where time counts: 64 pixels, of the scenes of `live`, averaged, by Muon.

    make weights NAME=nano DATA=DATA
    lime-train --recipe nano --data DATA --out runs/nano --reuse runs/live    # not shipped

SegmentationNet and the encoders of `live`, as it comes with the package, are trained on at 64
pixels; S and M, which are half as wide, from nothing. 2.4 hours of two cores with AVX-512, 0.8 of
them rendering; 15 GB of disk. The set of this name that comes with the package is its, of seed 0.

Scores on its validation scenes: mask IoU 83.9 %, right bin 26.4 % (or neighbouring 55.6 %),
log10 s 0.594, m_d 0.101, m_s 0.061, S 0.794, M 0.846.
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
