"""Shapes: procedural closed surfaces of three families, and meshes read from files."""

import numpy as np

from . import fields, lathe, solids
from .meshes import EXTENSIONS, Mesh, load

__all__ = ["EXTENSIONS", "Mesh", "load", "procedural"]


def procedural(rng: np.random.Generator) -> Mesh:
    """Makes a random closed surface: a composition, a turned piece or a blend of blobs.

    Args:
        rng: The only source of randomness; the same state gives the same mesh.

    Returns:
        One connected, watertight `Mesh` of 5,000 to 40,000 faces. Pieces turned on a lathe stand
        upright, the others lie as they fell.
    """
    family = rng.choice(3, p=(0.4, 0.3, 0.3))
    if family == 0:
        return solids.polygonise(*fields.composition(rng))
    if family == 1:
        return lathe.sample(rng)
    return solids.polygonise(*fields.blobs(rng))
