"""`best`, for photographs: 192 pixels, materials as common objects have them, by Muon.

    make weights NAME=best DATA=DATA REUSE=runs/live
    lime-train --recipe best --data DATA --out runs/best --reuse runs/live    # not shipped

The networks of `live`, trained on at 192 pixels: the mask, then the encoders; S and M stay as they
are. Some 12 hours of one core, or 2 with --reuse of a run of `live`. 25 GB of disk.
Scores: not trained yet. The set of this name that comes with the package is of before there were
recipes (lime_keras/pretrained/README.md).
"""

import dataclasses

from . import live, shared
from .recipe import Corpus

_CORPORA = shared.CORPORA | {"meshes-192": Corpus(20_000, seed=4, size=192)}

RECIPE = dataclasses.replace(
    live.RECIPE,
    corpora=_CORPORA,
    trainings=live.RECIPE.trainings
    | {
        "mask": dataclasses.replace(
            shared.MASKS["mask-192"], steps=1_000, rate=5e-4, start_from="mirror"
        ),
        "material-192": dataclasses.replace(
            shared.MATERIAL,
            corpora=("large", "meshes-192"),
            steps=2_500,
            rate=1e-3,
            photos=20_000,
            start_from="mask",
            materials=("natural",),
            size=192,
        ),
    },
    validation=dataclasses.replace(shared.VALIDATION, size=192),
)
