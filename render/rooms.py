"""Procedural rooms, path traced to environment maps of photographed dynamic range.

A `Room` is plain data; `sample` makes one, `render` asks Mitsuba for the light that arrives at its
viewpoint. Everything is grey, as the paper's light is white-balanced. Metres; Y up; the floor is
the plane y = 0, the vertical axis runs through the middle of the room.

One Mitsuba scene serves all rooms of a process: its meshes have a fixed number of faces, and each
room only fills their buffers. So nothing is compiled twice, and the memory that Mitsuba keeps with
every scene loaded (its issue 1890) is spent once.
"""

from dataclasses import dataclass
from functools import lru_cache

import mitsuba as mi
import numpy as np

Vector = tuple[float, float, float]
Pattern = tuple[tuple[float, ...], ...]

LIGHTS = 11  # emitters of the scene: up to three windows of sky and ground, and five lamps
FACES = {"matte": 16384, "glossy": 8192, "light": 640}  # of each mesh of the scene
BOUNCES = 4  # depth of the path tracer: enough to lift the shadows, too short for caustics
CLEARANCE = 0.3  # metres around the viewpoint that stay empty
SUBDIVISION = 8  # directions across and down a texel that are looked up in the views
VIEWS = (
    ((0, 0, -1), (0, 1, 0)),
    ((1, 0, 0), (0, 1, 0)),
    ((0, 0, 1), (0, 1, 0)),
    ((-1, 0, 0), (0, 1, 0)),
    ((0, 1, 0), (0, 0, 1)),
    ((0, -1, 0), (0, 0, -1)),
)  # forward and up


@dataclass(frozen=True)
class Panel:
    """A rectangle divided into cells, visible from the side of `across` x `up`.

    Attributes:
        corner: Its corner at the lower left.
        across: The edge to the right.
        up: The upward edge.
        cells: Rows from the bottom, the albedo of each cell; of lights ((0,),).
    """

    corner: Vector
    across: Vector
    up: Vector
    cells: Pattern


@dataclass(frozen=True)
class Solid:
    """A box, a cylinder upright or lying ("tube"), or an ellipsoid.

    Attributes:
        kind: "box", "cylinder", "tube" or "sphere".
        centre: Of its bounding box.
        extent: Half extents along its own axes.
        turn: Rotation about the vertical, radians.
        albedo: Between 0 and 1; of lamps 0.
        roughness: Of a glossy coat, between 0 and 1, or None for a matte solid.
    """

    kind: str
    centre: Vector
    extent: Vector
    turn: float
    albedo: float
    roughness: float | None = None


@dataclass(frozen=True)
class Light:
    """What emits the same radiance everywhere: a lamp, or the sky or the ground in a window."""

    radiance: float
    panels: tuple[Panel, ...] = ()
    solids: tuple[Solid, ...] = ()


@dataclass(frozen=True)
class Room:
    """A room: its width, height and depth, where it is seen from, what it holds and what shines."""

    size: Vector
    viewpoint: Vector
    panels: tuple[Panel, ...]
    solids: tuple[Solid, ...]
    lights: tuple[Light, ...]


def sample(rng: np.random.Generator) -> Room:
    """Draws a room: walls with patterns and pictures, windows, lamps and furniture.

    Args:
        rng: The only source of randomness.

    Returns:
        The room; its viewpoint keeps `CLEARANCE` from everything.
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
        size=_vector(size),
        viewpoint=_vector(viewpoint),
        panels=(*walls, *frames, *pictures),
        solids=tuple(_furniture(rng, size, viewpoint)),
        lights=tuple(lights),
    )


def render(room: Room, *, height: int = 128, samples: int = 32, seed: int) -> np.ndarray:
    """Path traces a room from its viewpoint, in the variant of Mitsuba that is active.

    Paths end after `BOUNCES` segments. Where no light is seen directly, a pixel of the six views
    may be at most twice as bright as its brightest neighbour, so that rare paths leave no speckles.

    Args:
        room: What to render.
        height: Rows of the map.
        samples: Paths per pixel of the six views that the map is put together from.
        seed: Of the sampler; the same seed gives the same map, to the bit if Dr.Jit has one thread.

    Returns:
        `(height, 2 * height)` float32 radiance, non-negative, one channel: equirectangular,
        direction(u, v) = (sin(pi v) sin(2 pi u), cos(pi v), -sin(pi v) cos(2 pi u)).

    Raises:
        ValueError: If the room has more faces or lights than the scene holds.
    """
    side = 3 * height // 4  # a view's pixels in its middle then are about as wide as the texels
    scene = _scene(mi.variant(), side)
    _furnish(scene[1], room)
    views = _views(scene, "path", side, samples, seed)
    lights = _views(scene, "lights", side, samples, seed)
    padded = np.pad(views, ((0, 0), (1, 1), (1, 1)), mode="edge")
    shifts = [(i, j) for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    around = np.max([padded[:, i : i + side, j : j + side] for i, j in shifts], axis=0)
    views = np.where(lights > 0, views, np.minimum(views, 2 * around))
    return _equirectangular(views, height)


# ---- drawing a room --------------------------------------------------------------------------


def _walls(rng: np.random.Generator, size: np.ndarray) -> list[Panel]:
    """Back, front, left, right, floor and ceiling, seen from inside."""
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
            _vector(np.array(corner) / 2),
            _vector(across),
            _vector(up),
            ((float(tone),),) if rng.random() < share else _pattern(rng, tone),
        )
        for corner, (across, up), tone, share in zip(corners, edges, tones, plain, strict=True)
    ]


def _pattern(rng: np.random.Generator, tone: float) -> Pattern:
    """Stripes, checks, a dado or patches around a tone."""
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
    return _cells(tone + (other - tone) * share)


def _on_wall(wall: Panel, rect: np.ndarray, lift: float, cells: Pattern) -> Panel:
    """A panel at `rect` (left, bottom, width, height; metres), lifted off the wall."""
    across, up = np.array(wall.across), np.array(wall.up)
    u, v = across / np.linalg.norm(across), up / np.linalg.norm(up)
    corner = np.array(wall.corner) + rect[0] * u + rect[1] * v + lift * np.cross(u, v)
    return Panel(_vector(corner), _vector(rect[2] * u), _vector(rect[3] * v), cells)


def _place(rng: np.random.Generator, wall: Panel, width: tuple, height: tuple) -> np.ndarray:
    """A random rectangle of a wall, kept off its edges."""
    room = np.array([np.linalg.norm(wall.across), np.linalg.norm(wall.up)]) - 0.4
    extent = np.minimum([rng.uniform(*width), rng.uniform(*height)], room)
    start = 0.2 + rng.uniform(0.3, 1.0, 2) * (room - extent)
    return np.r_[start, extent]


def _window(rng: np.random.Generator, wall: Panel) -> tuple[Panel, Light, Light]:
    """A frame, and behind its bars bright sky above darker ground."""
    rect = _place(rng, wall, (0.6, 3.0), (0.8, 2.0))
    bar, columns, rows = rng.uniform(0.03, 0.08), rng.integers(1, 4), rng.integers(1, 4)
    frame = _on_wall(wall, rect, 0.01, ((float(rng.uniform(0.05, 0.9)),),))
    cell = (rect[2:] - bar) / (columns, rows)
    horizon = rect[1] + rect[3] * rng.uniform(0.05, 0.6)
    halves: tuple[list, list] = ([], [])
    for left in rect[0] + bar + cell[0] * np.arange(columns):
        for low in rect[1] + bar + cell[1] * np.arange(rows):
            high, split = low + cell[1] - bar, np.clip(horizon, low, low + cell[1] - bar)
            for half, (a, b) in zip(halves, ((split, high), (low, split)), strict=True):
                if b > a:
                    pane = np.array([left, a, cell[0] - bar, b - a])
                    half.append(_on_wall(wall, pane, 0.02, ((0.0,),)))
    sky = np.exp(rng.uniform(np.log(2), np.log(40)))
    ground = sky * rng.uniform(0.05, 0.6)
    return frame, *(Light(float(x), tuple(h)) for x, h in zip((sky, ground), halves, strict=True))


def _picture(rng: np.random.Generator, wall: Panel) -> Panel:
    """A picture, a door or a poster: a framed patchwork."""
    rect = _place(rng, wall, (0.4, 1.8), (0.4, 1.4))
    cells = np.pad(rng.uniform(0.03, 0.95, rng.integers(1, 8, 2)), 1, constant_values=rng.random())
    return _on_wall(wall, rect, 0.015, _cells(cells))


def _lamp(rng: np.random.Generator, size: np.ndarray, viewpoint: np.ndarray) -> Light:
    """A bulb, globe, downlight, tube, ceiling panel or studio softbox."""
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
    solid = Solid(shape, _vector((x, y, z)), _vector(extent), float(rng.uniform(0, np.pi)), 0.0)
    flux = np.exp(rng.uniform(np.log(3), np.log(60)))
    return Light(float(flux / (np.pi * _area(_solid_piece(solid)))), solids=(solid,))


def _furniture(rng: np.random.Generator, size: np.ndarray, viewpoint: np.ndarray) -> list[Solid]:
    """Pieces on the floor that overlap neither one another nor the viewpoint."""
    solids: list[Solid] = []
    taken = [(viewpoint[[0, 2]], CLEARANCE)]
    if rng.random() < 0.5:  # what the object stands on
        tall, radius = viewpoint[1] - rng.uniform(CLEARANCE, 0.5), rng.uniform(0.25, 0.5)
        solids += _table(rng, viewpoint[[0, 2]], (radius, tall, radius))
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
    rng: np.random.Generator, kind: str, centre: np.ndarray, extent: np.ndarray, turn: float
) -> Solid:
    gloss = float(rng.uniform(0.15, 0.6)) if rng.random() < 0.3 else None
    albedo = float(rng.uniform(0.04, 0.85))
    return Solid(kind, _vector(centre), _vector(extent), float(turn), albedo, gloss)


def _block(rng: np.random.Generator, place: np.ndarray, extent: np.ndarray) -> list[Solid]:
    """A cupboard, column or ball on the floor, at times with a smaller one on top."""
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


def _table(rng: np.random.Generator, place: np.ndarray, extent: np.ndarray) -> list[Solid]:
    """A top on four legs or on a column."""
    w, h, d = extent[0], min(extent[1], 1.3), extent[2]
    top = _solid(rng, "box", (place[0], h - 0.02, place[1]), (w, 0.02, d), 0.0)
    if rng.random() < 0.4:
        leg = _solid(rng, "cylinder", (place[0], h / 2, place[1]), (0.06, h / 2 - 0.03, 0.06), 0.0)
        return [top, leg]
    solids = [top]
    feet = [(sx * (w - 0.05), sz * (d - 0.05)) for sx in (-1, 1) for sz in (-1, 1)]
    half = (0.03, h / 2 - 0.03, 0.03)
    for x, z in feet:
        centre = _vector((place[0] + x, h / 2, place[1] + z))
        solids.append(Solid("box", centre, _vector(half), 0.0, top.albedo))
    return solids


def _shelf(rng: np.random.Generator, place: np.ndarray, extent: np.ndarray) -> list[Solid]:
    """Boards between two sides, with a box standing on each."""
    w, h, d = extent[0], extent[1], extent[2] / 2
    boards = rng.integers(2, 6)
    gap = h / boards
    tone = float(rng.uniform(0.05, 0.8))
    solids = [
        Solid("box", _vector((place[0] + s * w, h / 2, place[1])), (0.015, h / 2, d), 0.0, tone)
        for s in (-1, 1)
    ]
    for k in range(boards):
        y = (k + 0.5) * gap
        solids.append(Solid("box", _vector((place[0], y, place[1])), (w, 0.015, d), 0.0, tone))
        half = rng.uniform((0.1 * w, 0.1 * gap, 0.3 * d), (0.9 * w, 0.4 * gap, 0.9 * d))
        centre = (place[0] + rng.uniform(-1, 1) * (w - half[0]), y + 0.02 + half[1], place[1])
        solids.append(_solid(rng, "box", centre, half, 0.0))
    return solids


# ---- from a room to triangles ----------------------------------------------------------------

Piece = tuple[np.ndarray, ...]  # vertices, normals, faces; the faces' albedo and roughness


def _panel_piece(panel: Panel) -> Piece:
    """Two triangles a cell."""
    cells = np.array(panel.cells)
    rows, columns = cells.shape
    across, up = np.array(panel.across), np.array(panel.up)
    i, j = np.mgrid[:rows, :columns].reshape(2, -1, 1)
    v = np.stack([i, i, i + 1, i + 1], 1) / rows
    u = np.stack([j, j + 1, j + 1, j], 1) / columns
    vertices = (np.array(panel.corner) + u * across + v * up).reshape(-1, 3)
    normal = np.cross(across, up)
    normals = np.broadcast_to(normal / np.linalg.norm(normal), vertices.shape)
    first = 4 * np.arange(cells.size)[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    albedo = np.repeat(cells.ravel(), 2)
    return vertices, normals, faces, albedo, np.ones(len(faces))


def _solid_piece(solid: Solid) -> Piece:
    """The unit solid, scaled, turned and put in its place."""
    vertices, normals, faces = _unit(solid.kind)
    c, s = np.cos(solid.turn), np.sin(solid.turn)
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    normals = normals / np.array(solid.extent)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    vertices = (vertices * solid.extent) @ turn + solid.centre
    roughness = 1.0 if solid.roughness is None else solid.roughness
    surface = np.full((2, len(faces)), [[solid.albedo], [roughness]])
    return vertices, normals @ turn, faces, *surface


@lru_cache
def _unit(kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, normals and faces of a solid of half extents 1."""
    if kind == "box":
        sides = [Panel((-1, -1, 1), (2, 0, 0), (0, 2, 0), ((0,),))]
        sides = [_panel_piece(side)[:3] for side in sides]
        turns = [np.eye(3)[list(p)] * np.array(q)[:, None] for p, q in _BOX_TURNS]
        return _merged([(v @ t.T, n @ t.T, f) for v, n, f in sides for t in turns])
    columns = 24
    if kind == "sphere":
        angle = np.linspace(0, np.pi, 13)
        rings = np.stack([np.sin(angle), -np.cos(angle)], 1)
        return _lathed(rings, rings, columns)
    rim, zero, one = np.array([1.0, 1.0]), np.zeros(2), np.array([[0.0, 1.0]])
    wall = _lathed(np.array([[1.0, -1.0], rim]), np.array([[1.0, 0.0]] * 2), columns)
    top = _lathed(np.array([rim, zero + one[0]]), np.repeat(one, 2, 0), columns)
    bottom = _lathed(np.array([-one[0], [1.0, -1.0]]), np.repeat(-one, 2, 0), columns)
    vertices, normals, faces = _merged([wall, top, bottom])
    if kind == "tube":  # lies along x
        axes = [1, 2, 0]
        return vertices[:, axes], normals[:, axes], faces
    return vertices, normals, faces


_BOX_TURNS = (
    ((0, 1, 2), (1, 1, 1)),
    ((0, 1, 2), (-1, 1, -1)),
    ((2, 1, 0), (1, 1, -1)),
    ((2, 1, 0), (-1, 1, 1)),
    ((0, 2, 1), (1, 1, -1)),
    ((0, 2, 1), (1, -1, 1)),
)  # permutation and signs of the rotations that carry the front of a box to its sides


def _lathed(rings: np.ndarray, slopes: np.ndarray, columns: int) -> tuple[np.ndarray, ...]:
    """Revolves points `(K, 2)` of radius and height and their normals about y."""
    angle = 2 * np.pi * np.arange(columns) / columns
    around = np.stack([np.cos(angle), np.ones(columns), -np.sin(angle)], 1)
    vertices = (rings[:, None, [0, 1, 0]] * around).reshape(-1, 3)
    normals = (slopes[:, None, [0, 1, 0]] * around).reshape(-1, 3)
    i, j = np.mgrid[: len(rings) - 1, :columns].reshape(2, -1)
    a, b = i * columns + j, i * columns + (j + 1) % columns
    lower = np.stack([a, b, b + columns], 1)[rings[i, 0] > 1e-9]
    upper = np.stack([a, b + columns, a + columns], 1)[rings[i + 1, 0] > 1e-9]
    return vertices, normals, np.concatenate([lower, upper])


def _merged(pieces: list[tuple[np.ndarray, ...]]) -> tuple[np.ndarray, ...]:
    """Joins pieces; whatever follows vertices, normals and faces is joined along its rows."""
    vertices, normals, faces, *values = zip(*pieces, strict=True)
    starts = np.cumsum([0] + [len(v) for v in vertices[:-1]])
    faces = [f + start for f, start in zip(faces, starts, strict=True)]
    return tuple(np.concatenate(part) for part in (vertices, normals, faces, *values))


def _area(piece: Piece) -> float:
    vertices, _, faces, _, _ = piece
    a, b, c = vertices[faces].swapaxes(0, 1)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def _vector(values: np.ndarray) -> Vector:
    return tuple(float(value) for value in values)


def _cells(values: np.ndarray) -> Pattern:
    return tuple(_vector(row) for row in values)


# ---- from triangles to Mitsuba ---------------------------------------------------------------


@lru_cache(maxsize=2)
def _scene(variant: str, side: int) -> tuple["mi.Scene", "mi.SceneParameters", dict]:
    """The scene that all rooms share, its parameters and integrators, for one variant and size."""
    albedo = {"type": "mesh_attribute", "name": "face_albedo"}
    rough = {"type": "mesh_attribute", "name": "face_roughness"}
    matte = {"type": "diffuse", "reflectance": albedo}
    glossy = {"type": "principled", "base_color": albedo, "roughness": rough, "specular": 0.5}
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    light = {"type": "area", "radiance": {"type": "uniform", "value": 1.0}}
    meshes = {"matte": _mesh("matte", matte), "glossy": _mesh("glossy", glossy)}
    meshes |= {f"light{k}": _mesh("light", black, light) for k in range(LIGHTS)}
    film = {"type": "hdrfilm", "pixel_format": "luminance", "rfilter": {"type": "box"}}
    cameras = {
        f"view{k}": {
            "type": "perspective",
            "fov": 90.0,
            "near_clip": 0.001,
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 0], forward, up),
            "film": film | {"width": side, "height": side},
        }
        for k, (forward, up) in enumerate(VIEWS)
    }
    sensor = {"type": "batch", "film": film | {"width": 6 * side, "height": side}} | cameras
    scene = mi.load_dict({"type": "scene", "sensor": sensor} | meshes)
    depths = {"path": BOUNCES, "lights": 1}
    integrators = {k: mi.load_dict({"type": "path", "max_depth": n}) for k, n in depths.items()}
    return scene, mi.traverse(scene), integrators


def _mesh(kind: str, bsdf: dict, emitter: dict | None = None) -> "mi.Mesh":
    """A mesh with as many faces as `FACES` says, all but one of them without area."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    if emitter:
        properties["emitter"] = mi.load_dict(emitter)
    faces = FACES[kind]
    mesh = mi.Mesh(kind, 2 * faces, faces, has_vertex_normals=True, props=properties)
    mesh.add_attribute("face_albedo", 1, [0.5] * faces)
    mesh.add_attribute("face_roughness", 1, [0.5] * faces)
    parameters = mi.traverse(mesh)
    for name, values in _buffers(kind, [], np.zeros(3)).items():
        parameters[name] = values
    parameters.update()
    return mesh


def _furnish(parameters: "mi.SceneParameters", room: Room) -> None:
    """Writes a room into the scene's buffers, the viewpoint at the origin."""
    if len(room.lights) > LIGHTS:
        raise ValueError(
            f"the room has {len(room.lights)} lights, expected at most {LIGHTS}; "
            f"leave some out or raise LIGHTS."
        )
    meshes = {
        "matte": [_panel_piece(panel) for panel in room.panels]
        + [_solid_piece(solid) for solid in room.solids if solid.roughness is None],
        "glossy": [_solid_piece(solid) for solid in room.solids if solid.roughness is not None],
    }
    for k in range(LIGHTS):
        light = room.lights[k] if k < len(room.lights) else Light(0.0)
        pieces = [*map(_panel_piece, light.panels), *map(_solid_piece, light.solids)]
        meshes[f"light{k}"] = pieces
        parameters[f"light{k}.emitter.radiance.value"] = light.radiance
        flux = light.radiance * sum(map(_area, pieces))
        # Not 0 for the last, or a room without light would leave Mitsuba nothing to choose from.
        parameters[f"light{k}.emitter.sampling_weight"] = float(flux) or 1e-6 * (k == LIGHTS - 1)
    for name, pieces in meshes.items():
        for key, values in _buffers(name.rstrip("0123456789"), pieces, room.viewpoint).items():
            parameters[f"{name}.{key}"] = values
        # Equal normals count as unchanged, and Mitsuba would compute its own for new positions.
        parameters.set_dirty(f"{name}.vertex_normals")
    parameters.update()


def _buffers(kind: str, pieces: list[Piece], origin: Vector) -> dict[str, np.ndarray]:
    """Mitsuba's flat buffers, filled up with faces of no area behind a tiny triangle far below."""
    room = FACES[kind]
    far = np.array([[0, 0, 0], [0, 0, 1e-3], [1e-3, 0, 0]]) - (0, 100, 0)
    tiny = (far + origin, np.tile([0.0, 1.0, 0.0], (3, 1)), np.arange(3)[None], *np.ones((2, 1)))
    vertices, normals, faces, albedo, roughness = _merged([tiny, *pieces])
    if len(faces) > room:
        raise ValueError(
            f"the room has {len(faces)} {kind} faces, expected at most {room}; "
            f"use fewer cells or solids, or raise FACES."
        )
    return {
        "vertex_positions": _filled(vertices - origin, far[0], 2 * room),
        "vertex_normals": _filled(normals, (0, 1, 0), 2 * room),
        "faces": _filled(faces, (0, 0, 0), room).astype(np.uint32),
        "face_albedo": _filled(albedo, 0, room),
        "face_roughness": _filled(roughness, 1, room),
    }


def _filled(values: np.ndarray, filler: np.ndarray, count: int) -> np.ndarray:
    out = np.empty((count, *values.shape[1:]), np.float32)
    out[: len(values)], out[len(values) :] = values, filler
    return out.ravel()


def _views(scene: tuple, kind: str, side: int, samples: int, seed: int) -> np.ndarray:
    """The six views `(6, side, side)`, non-finite pixels black."""
    image = mi.render(scene[0], integrator=scene[2][kind], seed=seed, spp=samples)
    image = np.array(image, np.float32).reshape(side, 6, side).swapaxes(0, 1)
    return np.where(np.isfinite(image), np.maximum(image, 0), 0)


def _equirectangular(views: np.ndarray, height: int) -> np.ndarray:
    """Averages the views over each texel's solid angle."""
    pixels, weights = _lookup(height, views.shape[1])
    values = (views.ravel()[pixels] * weights).reshape(height, SUBDIVISION, 2 * height, -1)
    return values.sum(axis=(1, 3)).astype(np.float32)


@lru_cache(maxsize=2)
def _lookup(height: int, side: int) -> tuple[np.ndarray, np.ndarray]:
    """For each sub-texel the view's pixel it falls in, and its share of the texel's solid angle."""
    rows = SUBDIVISION * height
    theta = np.pi * (np.arange(rows, dtype=np.float32)[:, None] + 0.5) / rows
    phi = np.pi * (np.arange(2 * rows, dtype=np.float32) + 0.5) / rows
    x, y, z = np.broadcast_arrays(
        np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)
    )
    pixels = np.zeros((rows, 2 * rows), np.int32)
    for k, (forward, up) in enumerate(VIEWS):
        right = np.cross(forward, up)
        ahead, aside, above = (a[0] * x + a[1] * y + a[2] * z for a in (forward, right, up))
        seen = ahead >= np.maximum(np.abs(aside), np.abs(above)) * np.float32(1 - 1e-6)
        column, row = (
            np.clip((1 + slope[seen] / ahead[seen]) / 2 * side, 0, side - 1).astype(np.int32)
            for slope in (aside, -above)
        )
        pixels[seen] = (k * side + row) * side + column
    weights = np.sin(theta).reshape(height, SUBDIVISION)
    weights = weights / weights.sum(1, keepdims=True) / SUBDIVISION
    return pixels, weights.reshape(-1, 1).astype(np.float32)
