"""The bodies of a shard: listed shapes, and endless ones, which no other shard has."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

MOST = 64
"""Largest number of bodies, and of lights, that a shard draws from.

A worker can hold so many in memory, so each is made once in a shard.
"""
EXAMPLES = 8
"""Examples that share a body or a mixed light: to make one takes as long as to render three."""


@dataclass(frozen=True)
class Body:
    """A body of a shard.

    Attributes:
        name: name of the listed shape; or, of an endless one, that of shard and number.
        place: numbers of the shard and of the body in it, of an endless shape; else None.
    """

    name: str
    place: tuple[int, int] | None = None


def count(shard_size: int) -> int:
    """Return the number of bodies, and of mixed lights, that a shard has."""
    return min(MOST, math.ceil(shard_size / EXAMPLES))


def draw(
    rng: np.random.Generator, names: Sequence[str], share: float, shard: int, shard_size: int
) -> list[Body]:
    """Draw the bodies of a shard.

    Args:
        rng: source of randomness.
        names: names of the listed shapes; each comes as often as the others.
        share: share of the bodies that are endless, above 0.
        shard: number of the shard.
        shard_size: number of examples in a shard.
    """
    number = count(shard_size)
    order = np.concatenate([rng.permutation(len(names)) for _ in range(-(-number // len(names)))])
    lots = rng.random(number)
    bodies = []
    for place, lot in enumerate(lots):
        if lot < share:
            bodies.append(Body(f"endless-{shard:05d}-{place:02d}", (shard, place)))
        else:
            bodies.append(Body(names[order[place]]))
    return bodies
