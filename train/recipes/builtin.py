"""`builtin`, what the data are worth: `live` of built-in shapes and rooms alone, by Muon.

    lime-train --recipe builtin --out runs/builtin

It downloads nothing and ships no weights. Its validation scenes are of the split `test` of another
seed than the paper's protocol has, so that no shape or room of them is seen or tested.

Some 3.5 hours on two cores (estimated from rates, see docs/how-to/recipes.md). 20 GB of disk.
Scores: not trained yet.
"""

import dataclasses

from . import shared
from .recipe import Corpus, Recipe

_SHAPES = Corpus(60_000, seed=2, meshes=False, maps=False, endless=0.75)

RECIPE = Recipe(
    preset="live",
    corpora={
        "shapes": _SHAPES,
        "large": dataclasses.replace(_SHAPES, count=10_000, seed=3, size=192),
    },
    trainings={
        name: dataclasses.replace(
            training, cutouts=False, corpora=("shapes" if name == "mask-128" else "large",)
        )
        for name, training in shared.MASKS.items()
    }
    | {
        "light": dataclasses.replace(shared.LIGHT_128, corpora=("shapes",)),
        "material": dataclasses.replace(
            shared.MATERIAL, corpora=("shapes",), materials=("natural",)
        ),
        "mirror": dataclasses.replace(shared.MIRROR, corpora=("shapes",), materials=("natural",)),
    },
    validation=dataclasses.replace(shared.VALIDATION, meshes=False, maps=False),
)
