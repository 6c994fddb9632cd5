"""`best`, for photographs: 192 pixels, materials as common objects have them, by Muon.

    make weights NAME=best DATA=DATA
    lime-train --recipe best --data DATA --out runs/best        # the same, but for `make ship`

Some 4 hours on two cores: 1.2 render, 1 masks, 1.1 S and M, 0.6 the encoders (estimated from
rates, see docs/how-to/recipes.md). 25 GB of disk.
Scores: not trained yet. The set of this name that comes with the package is of before there were
recipes (lime_keras/pretrained/README.md).
"""

import dataclasses

from . import shared
from .recipe import Corpus, Recipe

_CORPORA = {
    "large": shared.CORPORA["large"],
    "meshes": Corpus(20_000, seed=4, size=192),
    "shapes": Corpus(10_000, seed=5, size=192, meshes=False),
}
_ALL = tuple(_CORPORA)

RECIPE = Recipe(
    preset="live",
    size=192,
    corpora=_CORPORA,
    trainings=shared.MASKS
    | {
        "light": dataclasses.replace(
            shared.LIGHT, corpora=_ALL, steps=3_000, photos=40_000, start_from="mask-192"
        ),
        "material": dataclasses.replace(
            shared.MATERIAL, corpora=_ALL, steps=5_000, photos=40_000, materials=("natural",)
        ),
    },
    validation=dataclasses.replace(shared.VALIDATION, size=192),
    packages=shared.CUTOUTS,
)
