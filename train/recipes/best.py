"""`best`, for photographs: 192 pixels, materials as common objects have them, by Muon.

    make weights NAME=best DATA=DATA REUSE=runs/live
    lime-train --recipe best --data DATA --out runs/best --reuse runs/live    # not shipped

Masks, S and M of `live` are trained on at 192 pixels; the encoders are its own. Some 5 hours on two
cores, or 2 with --reuse of a run of `live` (estimated from rates, see docs/how-to/recipes.md).
30 GB of disk.
Scores: not trained yet. The set of this name that comes with the package is of before there were
recipes (lime_keras/pretrained/README.md).
"""

import dataclasses

from . import shared
from .recipe import Corpus, Recipe

_OWN = {
    "meshes-192": Corpus(20_000, seed=4, size=192),
    "shapes-192": Corpus(10_000, seed=5, size=192, meshes=False, endless=0.75),
}
_ALL = ("large", *_OWN)

RECIPE = Recipe(
    preset="live",
    size=192,
    corpora=shared.CORPORA | _OWN,
    trainings=shared.MASKS
    | {
        "light": shared.LIGHT_128,
        "mask": dataclasses.replace(
            shared.MASKS["mask-192"], steps=1_000, rate=5e-4, start_from="light"
        ),
        "light-192": dataclasses.replace(
            shared.LIGHT_128,
            corpora=_ALL,
            steps=1_500,
            rate=5e-4,
            photos=40_000,
            start_from="mask",
            size=None,
        ),
        "material": dataclasses.replace(
            shared.MATERIAL,
            corpora=_ALL,
            steps=5_000,
            photos=40_000,
            start_from="light-192",
            materials=("natural",),
        ),
        "mirror": dataclasses.replace(
            shared.MIRROR, corpora=_ALL, steps=3_000, materials=("natural",)
        ),
    },
    validation=dataclasses.replace(shared.VALIDATION, size=192),
    packages=shared.CUTOUTS,
)
