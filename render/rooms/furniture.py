"""Furniture of a room: tables, shelves and blocks, at random places on the floor."""

import numpy as np
from numpy.typing import ArrayLike

from . import panels
from .panels import Piece

CLEARANCE = 0.3  # metres around the viewpoint that stay empty


def sample(rng: np.random.Generator, size: np.ndarray, viewpoint: np.ndarray) -> list[Piece]:
    """Draw pieces on the floor that overlap neither one another nor the viewpoint."""
    solids: list[Piece] = []
    taken = [(viewpoint[[0, 2]], CLEARANCE)]
    if rng.random() < 0.5:  # a table under the viewpoint, for the object to stand on
        tall, radius = viewpoint[1] - rng.uniform(CLEARANCE, 0.5), rng.uniform(0.25, 0.5)
        solids += _table(rng, viewpoint[[0, 2]], np.array([radius, tall, radius]))
        taken = [(viewpoint[[0, 2]], 1.5 * radius)]
    for _ in range(rng.integers(2, 10)):
        extent = rng.uniform((0.15, 0.3, 0.15), (0.6, 0.7 * size[1], 0.5))
        radius = np.hypot(extent[0], extent[2])
        place = rng.uniform(-1, 1, 2) * (size[[0, 2]] / 2 - radius)
        if all(np.linalg.norm(place - other) > radius + far for other, far in taken):
            taken.append((place, radius))
            make = (_table, _shelf, _block, _block)[rng.integers(4)]
            solids += make(rng, place, extent)
    return solids


def _solid(
    rng: np.random.Generator, kind: str, centre: ArrayLike, extent: ArrayLike, turn: float
) -> Piece:
    gloss = rng.uniform(0.15, 0.6) if rng.random() < 0.3 else panels.MATTE
    return panels.solid(kind, centre, extent, turn, rng.uniform(0.04, 0.85), gloss)


def _block(rng: np.random.Generator, place: np.ndarray, extent: np.ndarray) -> list[Piece]:
    """Draw a cupboard, column or ball on the floor, at times with smaller ones on top."""
    solids, y, turn = [], 0.0, rng.uniform(0, np.pi)
    for k in range(rng.integers(1, 4)):
        kind = rng.choice(["box", "cylinder", "sphere"])
        half = np.array(extent) * 0.5 * rng.uniform(0.6, 1.0) ** k / (1, 1 + k, 1)
        if kind == "sphere":
            half[:] = min(half)
        if y + 2 * half[1] > 1.4 * extent[1]:
            break
        solids.append(_solid(rng, kind, (place[0], y + half[1], place[1]), half, turn))
        y += 2 * half[1]
        if kind == "sphere":
            break
    return solids


def _table(rng: np.random.Generator, place: np.ndarray, extent: np.ndarray) -> list[Piece]:
    """Draw a table: a top on four legs or on a column."""
    w, h, d = extent[0], min(extent[1], 1.3), extent[2]
    top = _solid(rng, "box", (place[0], h - 0.02, place[1]), (w, 0.02, d), 0.0)
    if rng.random() < 0.4:
        leg = _solid(rng, "cylinder", (place[0], h / 2, place[1]), (0.06, h / 2 - 0.03, 0.06), 0.0)
        return [top, leg]
    solids = [top]
    feet = [(sx * (w - 0.05), sz * (d - 0.05)) for sx in (-1, 1) for sz in (-1, 1)]
    half = (0.03, h / 2 - 0.03, 0.03)
    for x, z in feet:
        centre = (place[0] + x, h / 2, place[1] + z)
        solids.append(panels.solid("box", centre, half, albedo=top.albedo[0]))
    return solids


def _shelf(rng: np.random.Generator, place: np.ndarray, extent: np.ndarray) -> list[Piece]:
    """Draw a shelf: boards between two sides, with a box on each board."""
    w, h, d = extent[0], extent[1], extent[2] / 2
    boards = rng.integers(2, 6)
    gap = h / boards
    tone = float(rng.uniform(0.05, 0.8))
    solids = [
        panels.solid("box", (place[0] + s * w, h / 2, place[1]), (0.015, h / 2, d), albedo=tone)
        for s in (-1, 1)
    ]
    for k in range(boards):
        y = (k + 0.5) * gap
        solids.append(panels.solid("box", (place[0], y, place[1]), (w, 0.015, d), albedo=tone))
        half = rng.uniform((0.1 * w, 0.1 * gap, 0.3 * d), (0.9 * w, 0.4 * gap, 0.9 * d))
        centre = (place[0] + rng.uniform(-1, 1) * (w - half[0]), y + 0.02 + half[1], place[1])
        solids.append(_solid(rng, "box", centre, half, 0.0))
    return solids
