"""Random shapes: `procedural` ones, of which corpora keep a list, and `endless` ones.

Each family draws its own numbers of pieces, proportions and details, so that no two shapes of a
long run are alike.
"""

from collections.abc import Callable

import numpy as np

from . import carving, extrusion, fields, lathe, solids, wires
from .meshes import Mesh

CELLS = 50_000  # cells of the grid on which implicit fields without thin bars are polygonised

SIDES = 56  # number of sides of a turned piece: enough for 24 flutes

FAMILIES: dict[str, tuple[float, Callable[[np.random.Generator], Mesh]]] = {
    "composition": (0.063, lambda rng: solids.polygonise(*fields.composition(rng), CELLS)),
    "blobs": (0.05, lambda rng: solids.polygonise(*fields.blobs(rng), CELLS)),
    "frame": (0.076, lambda rng: solids.polygonise(*fields.frame(rng))),
    "turned": (0.089, lambda rng: lathe.sample(rng, SIDES)),
    "hollowed": (0.101, lambda rng: solids.polygonise(*fields.carved(rng), CELLS)),
    "dented": (0.089, lambda rng: solids.polygonise(*fields.dented(rng), CELLS)),
    "carved": (0.164, carving.sample),
    "extruded": (0.127, extrusion.sharp),
    "bevelled": (0.076, lambda rng: extrusion.bevelled(rng, CELLS)),
    "tubes": (0.089, wires.tubes),
    "chains": (0.013, wires.chains),
    "cages": (0.038, wires.cages),
    "branches": (0.025, wires.branches),
}
"""The families: share of the draws, and the function that draws a mesh."""


def endless(rng: np.random.Generator) -> Mesh:
    """Make random closed surfaces of one of the `FAMILIES`.

    Args:
        rng: The only source of randomness; the same state gives the same mesh.

    Returns:
        A normalised `Mesh` of a dozen to some 50,000 faces, mostly 500 to 15,000. Its surfaces are
        watertight; where a thing is made of several, they may overlap or lie apart.
    """
    shares = np.array([share for share, _ in FAMILIES.values()])
    family = list(FAMILIES)[rng.choice(len(shares), p=shares / shares.sum())]
    return FAMILIES[family][1](rng)


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
