"""`best`, for photographs: 192 pixels, materials as common objects have them, by Muon.

    make weights NAME=best DATA=DATA
    lime-train --recipe best --data DATA --out runs/best        # the same, but for `make ship`

The networks of `live`, as it comes with the package, trained on at 192 pixels: the mask, then the
encoders; S and M stay as they are. Some 1.5 hours on two cores. 10 GB of disk.

Scores: not trained yet. The set of this name that comes with the package is of before there were
recipes (lime_keras/pretrained/README.md). A trial of this recipe is ahead of it
(docs/lab/physics.md, "The same networks at 192 pixels").
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
