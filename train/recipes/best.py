"""`best`, for photographs: 192 pixels, materials as common objects have them, by Muon.

    make weights NAME=best DATA=DATA
    lime-train --recipe best --data DATA --out runs/best        # the same, but for `make ship`

The networks of `live`, as it comes with the package, trained on at 192 pixels: the mask, then the
encoders; S and M stay as they are. Some 3.5 hours on two cores without AVX-512: 0.4 rendering, 1
for the mask, 2 for photos, their input masks and the encoders, 0.1 evaluating; estimated 1.5 with
it. 10 GB of disk. The set of this name that comes with the package is its, of seed 0.

Scores on its validation scenes: mask IoU 95.4 %, right bin 29.8 % (or neighbouring 61.7 %),
log10 s 0.537, m_d 0.085, m_s 0.058, S 0.751, M 0.865. `best` of before there were recipes, which
had learnt from some of these meshes: 93.3 %, 25.2 % (57.8 %), 0.604, 0.091, 0.052, 0.756.
"""

import dataclasses

from . import shared
from .recipe import Corpus, Recipe

RECIPE = Recipe(
    preset="live",
    size=192,
    corpora={"meshes": Corpus(12_000, seed=4, size=192)},
    trainings={
        "mask": dataclasses.replace(
            shared.MASKS["mask-192"],
            corpora=("meshes",),
            steps=1_000,
            rate=5e-4,
            start_from="live",
            size=None,
            preset=None,
        ),
        "material": dataclasses.replace(
            shared.MATERIAL,
            corpora=("meshes",),
            steps=2_500,
            rate=1e-3,
            photos=20_000,
            start_from="mask",
            materials=("natural",),
        ),
    },
    validation=dataclasses.replace(shared.VALIDATION, size=192),
    packages=shared.CUTOUTS,
)
