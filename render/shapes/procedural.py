"""Procedural shapes: closed surfaces of four families."""

import numpy as np

from . import fields, lathe, solids
from .meshes import Mesh


def procedural(rng: np.random.Generator) -> Mesh:
    """Make a random closed surface: a composition, turned piece, blend of blobs, or thin frame.

    Args:
        rng: The only source of randomness; the same state gives the same mesh.

    Returns:
        One connected, watertight `Mesh` of 5,000 to 40,000 faces. Turned pieces stand upright; the
        others may lie in any way.
    """
    family = rng.choice(4, p=(0.25, 0.2, 0.2, 0.35))
    if family == 0:
        return solids.polygonise(*fields.composition(rng))
    if family == 1:
        return lathe.sample(rng)
    return solids.polygonise(*(fields.blobs if family == 2 else fields.frame)(rng))
