"""Shapes: procedural closed surfaces of three families, and meshes read from files.

Every mesh is normalised alike: centred on its bounding box, scaled so that the farthest vertex lies
on the unit sphere, right-handed, Y up, normals of length one pointing outwards.

The families follow the procedural shapes of Xu et al., "Deep image-based relighting from optimal
sparse samples" (2018), and Li et al., "Learning to reconstruct shape and spatially-varying
reflectance from a single image" (2018): displaced primitives joined at random. Surfaces of
revolution and metaballs are added to them for creases, hollows and necks.

Letters: `p` points (3, N); `d` (N,) approximate signed distance, negative inside.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from skimage.measure import marching_cubes

EXTENSIONS = (".obj", ".ply", ".stl", ".glb")

CREASE = np.radians(50)  # faces that meet at a larger angle keep separate normals
CORNER = np.radians(33)  # the same for the profile of a surface of revolution
CELLS = 150_000  # of the marching cubes' grid: 8,000 to 30,000 faces, about 0.1 s

Field = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Mesh:
    """A triangle mesh, centred, inside the unit sphere, right-handed, Y up.

    Attributes:
        vertices: `(V, 3)` float32, the farthest at distance 1 from the origin.
        faces: `(F, 3)` uint32, counter-clockwise seen from outside.
        normals: `(V, 3)` float32, of unit length, outwards; creased edges have doubled vertices.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray


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
        return _polygonise(*_composition(rng))
    if family == 1:
        return _turned(_profile(rng), rng)
    return _polygonise(*_blobs(rng))


def load(path: str | Path) -> Mesh:
    """Reads a mesh file and normalises it.

    Several parts become one mesh, non-finite vertices and degenerate faces are dropped. The file's
    own normals are used if they are finite and agree with the winding; otherwise normals are smooth
    except across creases of more than 50 degrees.

    Args:
        path: A file with one of the `EXTENSIONS`.

    Returns:
        The mesh, as large as the file says.

    Raises:
        ValueError: If the file is missing, of another kind, cannot be read or has no faces.
    """
    path = Path(path)
    if path.suffix.lower() not in EXTENSIONS:
        raise ValueError(
            f"{path}: not a mesh format known here; convert it to one of {', '.join(EXTENSIONS)}."
        )
    if not path.is_file():
        raise ValueError(f"{path}: no such file; check the path.")
    try:
        with path.open("rb") as file:
            scene = trimesh.load_scene(file, file_type=path.suffix[1:].lower(), process=False)
        vertices, faces, normals = _assembled(scene)
    except Exception as error:  # trimesh passes on whatever its many readers raise
        raise ValueError(f"{path}: cannot be read as a mesh ({error}); export it anew.") from error
    faces = _sound_faces(vertices, faces)
    if len(faces) == 0:
        raise ValueError(
            f"{path}: holds no face of finite, non-zero area; export the surface as triangles."
        )
    if _agree(vertices, faces, normals):
        return _normalised(vertices, faces, normals)
    return _normalised(*_creased(vertices, faces))


# ---- fields: what is inside ------------------------------------------------------------------


def _composition(rng: np.random.Generator) -> tuple[Field, float]:
    """Primitives grown out of one another, displaced: a field, and a radius that holds it."""
    parts, centres, sizes = [], [np.zeros(3)], []
    for k in range(rng.choice([1, 2, 3, 4, 5], p=(0.15, 0.25, 0.25, 0.2, 0.15))):
        size = rng.uniform(0.35, 0.7) if k else 0.7
        if k:
            parent = rng.integers(k)
            reach = rng.uniform(0.5, 1.0) * sizes[parent]
            centres.append(centres[parent] + reach * _direction(rng))
        sizes.append(size)
        parts.append(_primitive(rng, size, centres[k]))
    softness = rng.choice([0.0, rng.uniform(0.02, 0.3)], p=(0.35, 0.65))
    waves = _displacement(rng)

    def field(p: np.ndarray) -> np.ndarray:
        d = parts[0](p)
        for part in parts[1:]:
            d = _join(d, part(p), softness)
        return d - waves(p)

    return field, max(np.linalg.norm(c) + 1.8 * s for c, s in zip(centres, sizes, strict=True))


def _blobs(rng: np.random.Generator) -> tuple[Field, float]:
    """Balls on a random walk, blended and stretched, often mirrored left to right."""
    count = int(rng.integers(3, 10))
    radii = rng.uniform(0.12, 0.45, count).astype(np.float32)
    radii[0] = rng.uniform(0.3, 0.5)
    centres = np.zeros((count, 3), np.float32)
    for k in range(1, count):
        parent = rng.integers(max(0, k - 3), k)
        reach = rng.uniform(0.6, 0.95) * (radii[parent] + radii[k])
        centres[k] = centres[parent] + reach * _direction(rng)
    mirrored = rng.random() < 0.4
    softness = np.float32(np.exp(rng.uniform(np.log(0.02), np.log(0.12))))
    balls = list(zip(centres, radii, strict=True))
    stretch = rng.uniform(0.6, 1.4, (3, 1)).astype(np.float32)
    waves = _displacement(rng)

    def field(p: np.ndarray) -> np.ndarray:
        q = p * stretch
        if mirrored:
            q[0] = np.abs(q[0])
        distances = (np.sqrt(((q - c[:, None]) ** 2).sum(0)) - r for c, r in balls)
        total = sum(np.exp(np.minimum(-d / softness, 80)) for d in distances)
        return -softness * np.log(total + np.float32(1e-37)) - waves(p)

    reach = np.max(np.linalg.norm(centres, axis=1) + radii)
    return field, float(reach / stretch.min()) + 0.5


def _primitive(rng: np.random.Generator, size: float, centre: np.ndarray) -> Field:
    """A superquadric, rounded box or torus, turned at random, of half extents up to `size`."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0].astype(np.float32)
    a = (size * rng.uniform(0.35, 1.0, 3)).astype(np.float32)[:, None]
    centre = centre.astype(np.float32)[:, None]
    kind = rng.choice(3, p=(0.55, 0.3, 0.15))
    if kind == 0:
        e1, e2 = (float(e) for e in rng.choice([0.25, 0.6, 1.0, 1.0, 1.6], 2))
        return lambda p: _superquadric(turn @ (p - centre), a, e1, e2)
    if kind == 1:
        rounding = float(a.min()) * rng.uniform(0.05, 0.6)
        return lambda p: _box(turn @ (p - centre), a, rounding)
    ring, tube = 0.7 * size, size * rng.uniform(0.15, 0.3)
    return lambda p: _torus(turn @ (p - centre), ring, tube)


def _superquadric(p: np.ndarray, a: np.ndarray, e1: float, e2: float) -> np.ndarray:
    """Radial distance to a superquadric: |p| (1 - F^(-e1/2)), F its inside-outside function."""
    x, y, z = np.abs(p / a) + np.float32(1e-6)
    level = (x ** (2 / e2) + y ** (2 / e2)) ** (e2 / e1) + z ** (2 / e1)
    return np.sqrt((p * p).sum(0)) * (1 - (level + np.float32(1e-30)) ** (-e1 / 2))


def _box(p: np.ndarray, a: np.ndarray, rounding: float) -> np.ndarray:
    q = np.abs(p) - (a - np.float32(rounding))
    outside = np.sqrt((np.maximum(q, 0) ** 2).sum(0))
    return outside + np.minimum(q.max(0), 0) - np.float32(rounding)


def _torus(p: np.ndarray, ring: float, tube: float) -> np.ndarray:
    return np.hypot(np.hypot(p[0], p[2]) - np.float32(ring), p[1]) - np.float32(tube)


def _join(d: np.ndarray, other: np.ndarray, softness: float) -> np.ndarray:
    """The union, blended over `softness` by a quadratic; 0 leaves a sharp edge."""
    if softness == 0:
        return np.minimum(d, other)
    overlap = np.maximum(np.float32(softness) - np.abs(d - other), 0)
    return np.minimum(d, other) - overlap * overlap / np.float32(4 * softness)


def _displacement(rng: np.random.Generator) -> Field:
    """Plane waves of one band, often none; the slope is bounded so that nothing tears off."""
    if rng.random() < 0.4:
        return lambda p: np.float32(0)
    frequency = np.exp(rng.uniform(np.log(4), np.log(22)))
    amplitude = np.float32(rng.uniform(0.1, 0.55) / frequency)
    waves = np.stack([_direction(rng) for _ in range(5)]) * frequency
    waves = (waves * rng.uniform(0.7, 1.3, (5, 1))).astype(np.float32)
    phases = rng.uniform(0, 2 * np.pi, (5, 1)).astype(np.float32)
    return lambda p: amplitude * np.sin(waves @ p + phases).sum(0) / np.float32(np.sqrt(5))


def _direction(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


# ---- from a field to a mesh ------------------------------------------------------------------


def _polygonise(field: Field, radius: float) -> Mesh:
    """The zero level of a field inside a ball, with the field's gradient for normals."""
    low, high = _bounds(field, radius)
    step = (np.prod(high - low) / CELLS) ** (1 / 3)
    box = zip(low, high, strict=True)
    axes = [np.arange(a - 1.5 * step, b + 2 * step, step, np.float32) for a, b in box]
    volume = _sampled(field, axes)
    for axis in range(3):  # the border is outside, so that the surface closes
        for side in (0, -1):
            border = volume.swapaxes(0, axis)[side]
            np.maximum(border, np.float32(1e-3), out=border)
    # A grid point on the surface would become several vertices in one place.
    volume[np.abs(volume) < 0.01 * step] = 0.01 * step
    vertices, faces, _, _ = marching_cubes(volume, 0.0, spacing=(step,) * 3)
    vertices = (vertices + [axis[0] for axis in axes]).astype(np.float32)
    vertices, faces = _largest_component(vertices, faces)
    return _normalised(vertices, faces, _gradient(field, vertices.T, 0.25 * step).T)


def _bounds(field: Field, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """The box around the cells of a coarse grid that the surface can reach."""
    axis = np.linspace(-radius, radius, 24, dtype=np.float32)
    inside = _sampled(field, [axis] * 3) < axis[1] - axis[0]
    reached = [np.flatnonzero(inside.any(axis=other)) for other in ((1, 2), (0, 2), (0, 1))]
    return axis[[r[0] for r in reached]], axis[[r[-1] for r in reached]]


def _sampled(field: Field, axes: list[np.ndarray]) -> np.ndarray:
    grid = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")])
    return field(grid).reshape([len(axis) for axis in axes])


def _gradient(field: Field, p: np.ndarray, step: float) -> np.ndarray:
    """Central differences along the four diagonals of a tetrahedron."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], np.float32)
    return sum(c[:, None] * field(p + np.float32(step) * c[:, None]) for c in corners)


def _largest_component(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Leaves crumbs and cavities away."""
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    links = coo_array((np.ones(len(edges), bool), edges.T), shape=(len(vertices),) * 2)
    _, label = connected_components(links, directed=False)
    kept = label == np.bincount(label).argmax()
    return vertices[kept], (np.cumsum(kept) - 1)[faces[kept[faces[:, 0]]]]


# ---- surfaces of revolution ------------------------------------------------------------------


def _profile(rng: np.random.Generator) -> np.ndarray:
    """A polyline `(K, 2)` of radius and height, from the axis at the bottom back to the axis."""
    kind = rng.choice(3)
    if kind == 0:
        wall = _spline_profile(rng)
        return np.concatenate([[[0, wall[0, 1]]], wall, _cap(rng, *wall[-1])])
    if kind == 1:
        wall = _moulded_profile(rng)
        return np.concatenate([[[0, 0]], wall, _cap(rng, *wall[-1])])
    return _hollow(_spline_profile(rng), rng.uniform(0.03, 0.09))


def _spline_profile(rng: np.random.Generator) -> np.ndarray:
    """Random radii joined by Catmull-Rom pieces: bottles, vases, bowls."""
    count = rng.integers(3, 7)
    radii = rng.uniform(0.15, 1.0, count + 2)
    t = np.linspace(0, count - 1, 80)
    k = np.minimum(t.astype(int), count - 2)
    f = t - k
    p0, p1, p2, p3 = (radii[k + j] for j in range(4))
    spline = p1 + f * (p2 - p0) / 2 + f**2 * (p0 - 2.5 * p1 + 2 * p2 - p3 / 2)
    spline += f**3 * (1.5 * (p1 - p2) + (p3 - p0) / 2)
    height = np.exp(rng.uniform(np.log(0.6), np.log(4.0)))
    return np.stack([np.maximum(spline, 0.12), height * t / t[-1]], axis=1)


def _moulded_profile(rng: np.random.Generator) -> np.ndarray:
    """Stacked mouldings with sharp edges between them: chessmen, balusters, spinning tops."""
    radius, y, pieces = rng.uniform(0.5, 1.0), 0.0, []
    for _ in range(rng.integers(3, 8)):
        target, height = rng.uniform(0.18, 1.0), rng.uniform(0.1, 0.7)
        f = np.linspace(0, 1, 20)
        ease = [f, 1 - np.sqrt(1 - f**2), np.sqrt(1 - (1 - f) ** 2), f * f * (3 - 2 * f)]
        bulge = rng.choice([0.0, 0.5, -0.3], p=(0.65, 0.25, 0.1)) * height * np.sin(np.pi * f)
        radii = radius + (target - radius) * ease[rng.integers(4)] + bulge
        pieces.append(np.stack([np.maximum(radii, 0.1), y + height * f], axis=1))
        radius = target if rng.random() < 0.7 else rng.uniform(0.2, 1.0)
        y += height
    return np.concatenate(pieces)


def _cap(rng: np.random.Generator, radius: float, y: float) -> np.ndarray:
    """Closes the top: flat, domed, pointed, or with a knob on it."""
    kind = rng.choice(4)
    if kind == 0:
        return np.array([[0.0, y]])
    a = np.linspace(0, np.pi / 2, 24)[1:]
    if kind == 1:
        return np.stack([radius * np.cos(a), y + radius * rng.uniform(0.2, 1.2) * np.sin(a)], 1)
    if kind == 2:
        f = np.linspace(0, 1, 20)[1:]
        return np.stack([radius * (1 - f), y + radius * rng.uniform(0.4, 1.5) * f], 1)
    knob = radius * rng.uniform(0.5, 1.1)
    a = np.linspace(-np.pi / 3, np.pi / 2, 30)
    return np.stack([knob * np.cos(a), y + knob * (np.sin(a) + np.sin(np.pi / 3))], 1)


def _hollow(wall: np.ndarray, thickness: float) -> np.ndarray:
    """A vessel: up the outside, over a round lip, down the inside to the floor."""
    a = np.linspace(0, np.pi, 9)[1:-1]
    rim = wall[-1] - (thickness / 2, 0)
    lip = rim + thickness / 2 * np.stack([np.cos(a), np.sin(a)], 1)
    inside = wall[::-1] - (thickness, 0)
    inside = inside[inside[:, 1] > thickness]
    return np.concatenate([[[0, 0]], wall, lip, inside, [[0, inside[-1, 1]]]])


def _turned(profile: np.ndarray, rng: np.random.Generator) -> Mesh:
    """Revolves a profile about Y, at times fluted, with creases at its sharp corners."""
    profile[[0, -1], 0] = 0
    profile = profile[np.r_[True, np.linalg.norm(np.diff(profile, axis=0), axis=1) > 1e-4]]
    profile[-1, 0] = 0
    flutes = int(rng.integers(3, 25))
    depth = rng.choice([0.0, rng.uniform(0.1, 0.6) / flutes], p=(0.6, 0.4))
    twist = rng.choice([0.0, rng.uniform(-1.0, 1.0)])
    angle = 2 * np.pi * np.arange(88) / 88
    vertices, normals, faces, count = [], [], [], 0
    for section in _sections(profile):
        points, outward = _revolved(section, angle, flutes, depth, twist)
        vertices.append(points.reshape(-1, 3))
        normals.append(outward.reshape(-1, 3))
        faces.append(count + _strip_faces(section[:, 0], len(angle)))
        count += len(vertices[-1])
    return _normalised(*(np.concatenate(part) for part in (vertices, faces, normals)))


def _sections(profile: np.ndarray) -> list[np.ndarray]:
    """Cuts a polyline at its corners; long straight pieces get points of their own."""
    tangents = np.diff(profile, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    cosine = (tangents[1:] * tangents[:-1]).sum(1)
    cuts = [0, *(np.flatnonzero(cosine < np.cos(CORNER)) + 1), len(profile) - 1]
    sections = [profile[a : b + 1] for a, b in pairwise(cuts)]
    share = np.linspace(0, 1, 9)[:, None]
    return [s[0] + share * (s[1] - s[0]) if len(s) == 2 else s for s in sections]


def _revolved(
    section: np.ndarray, angle: np.ndarray, flutes: int, depth: float, twist: float
) -> tuple[np.ndarray, np.ndarray]:
    """Points and outward normals `(rows, angles, 3)`: the cross product of both tangents."""
    radius, y = section[:, :1], np.broadcast_to(section[:, 1:], (len(section), len(angle)))
    phase = flutes * (angle + twist * y)
    ripple = 1 + depth * np.cos(phase)
    across = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], 1)
    along = np.stack([-np.sin(angle), 0 * angle, np.cos(angle)], 1)
    points = (radius * ripple)[..., None] * across
    points[..., 1] = y
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(section, axis=0), axis=1))]
    up = np.gradient(points, length, axis=0, edge_order=min(2, len(section) - 1))
    # The tangent around is divided by the radius, so that it stays finite on the axis.
    around = ripple[..., None] * along - (flutes * depth * np.sin(phase))[..., None] * across
    return points, np.cross(up, around)


def _strip_faces(radii: np.ndarray, sides: int) -> np.ndarray:
    """Triangles between neighbouring rings; a ring on the axis spends one triangle a side."""
    row, side = np.mgrid[: len(radii) - 1, :sides].reshape(2, -1)
    a, b = row * sides + side, row * sides + (side + 1) % sides
    lower = np.stack([a, a + sides, b], 1)[radii[row] > 0]
    upper = np.stack([b, a + sides, b + sides], 1)[radii[row + 1] > 0]
    return np.concatenate([lower, upper])


# ---- normalisation and repair ----------------------------------------------------------------


def _normalised(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> Mesh:
    """Centres, scales, drops unused vertices, and turns a closed surface outside out."""
    used, faces = np.unique(faces, return_inverse=True)
    vertices, normals = np.asarray(vertices, float)[used], np.asarray(normals, float)[used]
    faces = faces.reshape(-1, 3)
    vertices = vertices - (vertices.min(0) + vertices.max(0)) / 2
    vertices /= np.linalg.norm(vertices, axis=1).max()
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(lengths > 0, normals / np.maximum(lengths, 1e-30), (0.0, 1.0, 0.0))
    a, b, c = vertices[faces].swapaxes(0, 1)
    if (np.cross(a, b) * c).sum() < 0:  # six times the enclosed volume
        faces = faces[:, ::-1]
        normals = -normals
    return Mesh(vertices.astype("f4"), np.ascontiguousarray(faces, "u4"), normals.astype("f4"))


def _assembled(scene: trimesh.Scene) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All parts in their places; normals that the file does not give are NaN."""
    vertices, faces, normals, count = [np.zeros((0, 3))], [np.zeros((0, 3), int)], [], 0
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        part = scene.geometry[name]
        if not len(getattr(part, "faces", ())):
            continue  # points and lines
        linear = matrix[:3, :3]
        vertices.append(part.vertices @ linear.T + matrix[:3, 3])
        turned = -1 if np.linalg.det(linear) < 0 else 1  # a mirror image turns the winding
        faces.append(count + part.faces[:, ::turned])
        # trimesh makes normals up when asked for them; only the cache tells which were read.
        given = "vertex_normals" in part._cache.cache
        blank = np.full(part.vertices.shape, np.nan)
        normals.append(part.vertex_normals @ np.linalg.inv(linear) if given else blank)
        count += len(part.vertices)
    return tuple(np.concatenate(p) for p in (vertices, faces, [np.zeros((0, 3)), *normals]))


def _sound_faces(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The faces of finite corners and of an area that is not rounding error."""
    finite = np.isfinite(vertices).all(1)
    faces = faces[finite[faces].all(1)]
    if len(faces) == 0:
        return faces
    extent = np.ptp(vertices[faces].reshape(-1, 3), axis=0).max()
    return faces[np.linalg.norm(_face_normals(vertices, faces), axis=1) > 1e-12 * extent**2]


def _face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Normals as long as twice the faces' areas."""
    a, b, c = vertices[faces].swapaxes(0, 1)
    return np.cross(b - a, c - a)


def _agree(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> bool:
    """Whether given normals are finite, not zero, and on the winding's side for nine in ten."""
    given = normals[faces]
    if not np.isfinite(given).all() or (np.linalg.norm(given, axis=-1) < 1e-6).any():
        return False
    side = (given * _face_normals(vertices, faces)[:, None]).sum(-1)
    return bool((side > 0).mean() > 0.9)


def _creased(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joins equal positions, then smooths within patches bounded by creases."""
    corners = vertices[faces].reshape(-1, 3)
    positions, same = np.unique(corners, axis=0, return_inverse=True)
    joined = trimesh.Trimesh(positions, same.reshape(-1, 3), process=False)
    smooth = trimesh.graph.smooth_shade(joined, angle=CREASE)
    return smooth.vertices, smooth.faces, smooth.vertex_normals
