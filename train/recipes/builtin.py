"""`builtin`, without any data: S and encoders of `live` of built-in shapes and rooms, by Muon.

    lime-train --recipe builtin --out runs/builtin

It shows what the meshes and maps of `live` are worth, downloads nothing and ships no weights. The
mask and M are those of `live`, as it comes with the package; S and the encoders learn from nothing,
of as many scenes as those of `live`, for as many batches. Its validation scenes are of the split
`test` of another seed than the paper's protocol has, so that no shape or room of them is seen or
tested. 15 GB of disk. Scores on the validation scenes of `live`: right bin 29.1 % (58.0 %), log10 s
0.560, m_d 0.088, m_s 0.056, S 0.766; `live` has 27.2 % (59.7 %), 0.561, 0.088, 0.055, 0.758.
"""

import dataclasses

from . import live, shared
from .recipe import Corpus, Recipe

RECIPE = Recipe(
    preset="live",
    corpora={"shapes": Corpus(60_000, seed=2, meshes=False, maps=False, endless=0.75)},
    trainings={
        "light": dataclasses.replace(
            live.RECIPE.trainings["light"],
            stages=("specular",),
            corpora=("shapes",),
            start_from="live",
            options=("--fresh", "specular", "exponent", "albedo"),
        ),
        "material": dataclasses.replace(live.RECIPE.trainings["material"], corpora=("shapes",)),
    },
    validation=dataclasses.replace(shared.VALIDATION, meshes=False, maps=False),
)
