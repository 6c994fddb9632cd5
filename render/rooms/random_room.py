"""Procedural rooms, drawn at random as plain data.

Everything is grey, as the paper's light is white-balanced. Lengths are in metres; Y is up. The
floor is the plane y = 0, and the vertical axis runs through the middle of the room.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from . import panels
from .panels import Panel, Piece

LIGHTS = 11  # largest number of emitters: sky and ground of three windows, and five lamps
CLEARANCE = 0.3  # metres around the viewpoint that stay empty


@dataclass(frozen=True)
class Light:
    """An emitter of uniform radiance: a lamp, or the sky or the ground behind a window."""

    radiance: float
    panels: tuple[Panel, ...] = ()
    solids: tuple[Piece, ...] = ()


@dataclass(frozen=True)
class Room:
    """A room: its size (width, height, depth), viewpoint, panels, solids and lights."""

    size: np.ndarray
    viewpoint: np.ndarray
    panels: tuple[Panel, ...]
    solids: tuple[Piece, ...]
    lights: tuple[Light, ...]


def sample(rng: np.random.Generator) -> Room:
    """Draw a room: walls with patterns and pictures, windows, lamps and furniture.

    Args:
        rng: The only source of randomness.

    Returns:
        The room; nothing is nearer to its viewpoint than `CLEARANCE`.
    """
    size = np.array([rng.uniform(3, 8), rng.uniform(2.3, 4), rng.uniform(3, 8)])
    viewpoint = np.array([rng.uniform(-0.5, 0.5), 0, rng.uniform(-0.5, 0.5)]) * (size - 2)
    viewpoint[1] = rng.uniform(0.7, 1.6)
    walls = _walls(rng, size)
    order = rng.permutation(4)
    glazed = rng.choice(4, p=(0.2, 0.4, 0.25, 0.15))
    frames, lights = [], []
    for k in order[:glazed]:
        frame, sky, ground = _window(rng, walls[k])
        frames.append(frame)
        lights += [sky, ground]
    lights += [_lamp(rng, size, viewpoint) for _ in range(rng.integers(1, 6))]
    pictures = [_picture(rng, walls[k]) for k in order[glazed:] if rng.random() < 0.6]
    return Room(
        size=size,
        viewpoint=viewpoint,
        panels=(*walls, *frames, *pictures),
        solids=tuple(_furniture(rng, size, viewpoint)),
        lights=tuple(lights),
    )


def _walls(rng: np.random.Generator, size: np.ndarray) -> list[Panel]:
    """Draw the walls back, front, left and right, the floor and the ceiling, seen from inside."""
    w, h, d = size
    x, y, z = np.diag(size)
    corners = [(-w, 0, -d), (w, 0, d), (-w, 0, d), (w, 0, -d), (-w, 0, d), (-w, 2 * h, -d)]
    edges = [(x, y), (-x, y), (-z, y), (z, y), (x, -z), (x, z)]
    tone = rng.uniform(0.25, 0.85)
    tones = [*np.clip(tone + rng.normal(0, 0.08, 4), 0.1, 0.9), rng.uniform(0.08, 0.6)]
    tones.append(rng.uniform(0.5, 0.9))
    plain = [0.55] * 4 + [0.4, 0.85]
    return [
        Panel(
            np.array(corner) / 2,
            across,
            up,
            [[tone]] if rng.random() < share else _pattern(rng, tone),
        )
        for corner, (across, up), tone, share in zip(corners, edges, tones, plain, strict=True)
    ]


def _pattern(rng: np.random.Generator, tone: float) -> np.ndarray:
    """Draw a pattern of albedos around a tone: stripes, checks, a dado or patches."""
    rows, columns = rng.integers(4, 20, 2)
    other = np.clip(tone * np.exp(rng.choice([-1, 1]) * rng.uniform(0.3, 1.5)), 0.03, 0.95)
    i, j = np.mgrid[:rows, :columns]
    kind = rng.choice(5)
    if kind == 0:
        share = np.broadcast_to(j[:1] % 2, (1, columns))
    elif kind == 1:
        share = i[:, :1] % 2
    elif kind == 2:
        share = (i + j) % 2
    elif kind == 3:
        share = i[:, :1] < rows * rng.uniform(0.2, 0.5)
    else:
        share = rng.random((rows, columns))
    return tone + (other - tone) * share


def _on_wall(wall: Panel, rect: np.ndarray, lift: float, cells: ArrayLike) -> Panel:
    """Return a panel at `rect` (left, bottom, width, height in metres), lifted off the wall."""
    across, up = np.array(wall.across), np.array(wall.up)
    u, v = across / np.linalg.norm(across), up / np.linalg.norm(up)
    corner = np.array(wall.corner) + rect[0] * u + rect[1] * v + lift * np.cross(u, v)
    return Panel(corner, rect[2] * u, rect[3] * v, cells)


def _place(rng: np.random.Generator, wall: Panel, width: tuple, height: tuple) -> np.ndarray:
    """Draw a rectangle (left, bottom, width, height) of a wall, away from the wall's edges."""
    room = np.array([np.linalg.norm(wall.across), np.linalg.norm(wall.up)]) - 0.4
    extent = np.minimum([rng.uniform(*width), rng.uniform(*height)], room)
    start = 0.2 + rng.uniform(0.3, 1.0, 2) * (room - extent)
    return np.r_[start, extent]


def _window(rng: np.random.Generator, wall: Panel) -> tuple[Panel, Light, Light]:
    """Draw a window: its frame with bars, the bright sky and the darker ground behind it."""
    rect = _place(rng, wall, (0.6, 3.0), (0.8, 2.0))
    bar, columns, rows = rng.uniform(0.03, 0.08), rng.integers(1, 4), rng.integers(1, 4)
    frame = _on_wall(wall, rect, 0.01, [[rng.uniform(0.05, 0.9)]])
    cell = (rect[2:] - bar) / (columns, rows)
    horizon = rect[1] + rect[3] * rng.uniform(0.05, 0.6)
    halves: tuple[list, list] = ([], [])
    for left in rect[0] + bar + cell[0] * np.arange(columns):
        for low in rect[1] + bar + cell[1] * np.arange(rows):
            high, split = low + cell[1] - bar, np.clip(horizon, low, low + cell[1] - bar)
            for half, (a, b) in zip(halves, ((split, high), (low, split)), strict=True):
                if b > a:
                    pane = np.array([left, a, cell[0] - bar, b - a])
                    half.append(_on_wall(wall, pane, 0.02, [[0.0]]))
    sky = np.exp(rng.uniform(np.log(2), np.log(40)))
    ground = sky * rng.uniform(0.05, 0.6)
    above, below = halves
    return frame, Light(float(sky), tuple(above)), Light(float(ground), tuple(below))


def _picture(rng: np.random.Generator, wall: Panel) -> Panel:
    """Draw a picture, a door or a poster: patches of random albedo in a frame."""
    rect = _place(rng, wall, (0.4, 1.8), (0.4, 1.4))
    cells = np.pad(rng.uniform(0.03, 0.95, rng.integers(1, 8, 2)), 1, constant_values=rng.random())
    return _on_wall(wall, rect, 0.015, cells)


def _lamp(rng: np.random.Generator, size: np.ndarray, viewpoint: np.ndarray) -> Light:
    """Draw a lamp: a bulb, globe, downlight, tube, ceiling panel or studio softbox."""
    top = size[1]
    kind = rng.choice(["bulb", "globe", "downlight", "tube", "panel", "softbox"])
    shape, extent, y = {
        "bulb": ("sphere", [rng.uniform(0.03, 0.08)] * 3, rng.uniform(1.2, top - 0.2)),
        "globe": ("sphere", [rng.uniform(0.1, 0.3)] * 3, rng.uniform(1.2, top - 0.3)),
        "downlight": ("cylinder", [rng.uniform(0.04, 0.12), 0.01, 0.0], top - 0.01),
        "tube": ("tube", [rng.uniform(0.3, 0.9), rng.uniform(0.015, 0.04), 0.0], top - 0.15),
        "panel": ("box", [rng.uniform(0.15, 0.6), 0.01, rng.uniform(0.15, 0.6)], top - 0.01),
        "softbox": ("box", [rng.uniform(0.2, 0.5), rng.uniform(0.2, 0.6), 0.02], 1.7),
    }[kind]
    if kind in ("downlight", "tube"):
        extent[2] = extent[0] if kind == "downlight" else extent[1]
    reach = size / 2 - max(extent[0], extent[2]) - 0.05
    for _ in range(100):
        x, z = rng.uniform(-1, 1, 2) * reach[[0, 2]]
        if np.linalg.norm([x - viewpoint[0], y - viewpoint[1], z - viewpoint[2]]) > 1.2:
            break
    solid = panels.solid(shape, (x, y, z), extent, rng.uniform(0, np.pi))
    flux = np.exp(rng.uniform(np.log(3), np.log(60)))
    return Light(float(flux / (np.pi * panels.area(solid))), solids=(solid,))


def _furniture(rng: np.random.Generator, size: np.ndarray, viewpoint: np.ndarray) -> list[Piece]:
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
