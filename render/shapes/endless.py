"""Random shapes without end, drawn from many families."""

from collections.abc import Callable

import numpy as np

from . import fields, lathe, solids
from .meshes import Mesh

CELLS = 60_000
"""Cells of the grid on which implicit fields are polygonised: 3,000 to 14,000 faces."""

FAMILIES: dict[str, tuple[float, Callable[[np.random.Generator], Mesh]]] = {
    "composition": (0.3, lambda rng: solids.polygonise(*fields.composition(rng), CELLS)),
    "blobs": (0.2, lambda rng: solids.polygonise(*fields.blobs(rng), CELLS)),
    "frame": (0.3, lambda rng: solids.polygonise(*fields.frame(rng), CELLS)),
    "turned": (0.2, lathe.sample),
}
"""The families: share of the draws, and the function that draws a mesh."""


def endless(rng: np.random.Generator) -> Mesh:
    """Make a random closed surface of one of the `FAMILIES`.

    Args:
        rng: The only source of randomness; the same state gives the same mesh.

    Returns:
        A watertight `Mesh`.
    """
    shares = np.array([share for share, _ in FAMILIES.values()])
    make = list(FAMILIES.values())[rng.choice(len(shares), p=shares / shares.sum())][1]
    return make(rng)
