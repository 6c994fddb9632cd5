"""`best`, for photographs: 192 pixels, materials as common objects have them, by Muon.

    make weights NAME=best DATA=DATA REUSE=runs/live
    lime-train --recipe best --data DATA --out runs/best --reuse runs/live    # not shipped

The networks of `live`, trained on at 192 pixels: the mask, then the encoders; S and M stay as they
are. Some 12 hours of one core, or 3 with --reuse of a run of `live`. 25 GB of disk.

Scores on its validation scenes: mask IoU 95.3 %, right bin 30.0 % (or neighbouring 60.2 %),
log10 s 0.539, m_d 0.083, m_s 0.058, S 0.752, M 0.866. The set of this name that comes with the
package is of before there were recipes (lime_keras/pretrained/README.md), and has on them 93.3 %,
25.2 % (57.8 %), 0.604, 0.091, 0.052, 0.756, 0.851; some of their meshes were in its training.
"""

import dataclasses

from . import live, shared
from .recipe import Corpus

RECIPE = dataclasses.replace(
    live.RECIPE,
    corpora=shared.CORPORA | {"meshes-192": Corpus(20_000, seed=4, size=192)},
    trainings={
        **live.RECIPE.trainings,
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
