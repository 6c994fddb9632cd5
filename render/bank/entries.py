"""The entries of a bank: a body, deformed and posed at random, and its G-buffer, compressed.

Eight entries in a row show one body, each deformed and posed anew: to read or to make a body takes
longer than to trace it. With a folder of meshes, every other eight show a mesh of the folder, so
half of all entries do; the meshes come round in random order, each as often as the others. All
other bodies are procedural, and none of them appears in two such rows.
"""

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from lime_keras.optics import octahedral
from lime_keras.optics.shading import view_directions
from lime_keras.synthesis import geometry

from ..scene.example import LEAST_COVERAGE
from ..scene.gbuffer import GBuffer, Tracer, lifted
from ..scene.quality import FAST
from ..scene.sampling import Pose, sample_pose
from ..scene.sources import generator
from ..shapes.deformation import deformed
from ..shapes.endless import endless
from ..shapes.meshes import Mesh
from .description import Job
from .surfaces import parted

ROW = 8
"""Number of entries in a row that show one body."""
FILL = (0.35, 1.05)
"""Share of the crop that the object's longer side takes: more widely drawn than in corpora, whose
photos are framed by the detector of the mask."""
CUT = 0.15
"""Share of the entries whose crop is moved further, so that its frame may cut the object."""
_FARTHEST_CUT = 0.25
"""Largest such move, across and up, as a share of the object's longer side."""
_LEAST_COSINE_OF_COARSE_CODES = 0.05
_TRIES = 20
_TRIES_OF_A_BODY = 4
QUALITY = dataclasses.replace(FAST, refined=5, rough_above=math.inf)
"""The samples: 3 × 3 of a pixel, and 5 × 5 at a silhouette, where coverage needs them.

The coverage of edge pixels is then 0.023 off (root mean square, against 15 × 15; 6 × 6: 0.018, in
12 % more time), and 7 % of the pixels that the object just touches are missed.
"""


@dataclass(frozen=True)
class Entry:
    """An entry of a bank.

    Attributes:
        data: the compressed G-buffer (`lime_keras.synthesis.geometry`).
        shape: row of its body in `Bodies.names`.
        camera: fx, fy, cx, cy in pixels.
        failures: one item for each earlier attempt that could not be used.
    """

    data: bytes
    shape: int
    camera: np.ndarray
    failures: list[dict[str, Any]]


class Bodies:
    """The bodies of a bank: meshes of the user's folder, and procedural ones."""

    def __init__(self, job: Job):
        self._seed, self._split = job.description.seed, job.description.split
        self._size = job.description.size
        self._source = job.shapes
        self._files = self._source.names() if self._source else []
        rows = -(-job.description.count // ROW)
        self.names = [
            *self._files,
            *(f"procedural-{number:05d}" for number in range(-(-rows // self._kinds))),
        ]
        """Names of all bodies: the files, then the procedural bodies."""
        self.mesh = functools.lru_cache(2)(self._mesh)
        self.tracer = functools.lru_cache(2)(self._tracer)

    @property
    def _kinds(self) -> int:
        return 2 if self._files else 1

    def of_entry(self, index: int, attempt: int) -> int:
        """Return the row in `names` of the body that an attempt at an entry shows.

        Where a mesh of the folder fails a few times, a procedural body takes its place.
        """
        row = index // ROW
        procedural = len(self._files) + row // self._kinds
        if not self._files or row % 2 or attempt >= _TRIES_OF_A_BODY:
            return procedural
        turn, place = divmod(row // 2, len(self._files))
        order = generator(self._seed, self._split, "order", turn).permutation(len(self._files))
        return int(order[place])

    def _tracer(self, shape: int) -> Tracer:
        return _tracer(self.mesh(shape), self._size)

    def _mesh(self, shape: int) -> Mesh:
        if shape < len(self._files) and self._source:
            return self._source.load(self._files[shape])
        return endless(generator(self._seed, self._split, "body", shape - len(self._files)))


def _tracer(mesh: Mesh, size: int) -> Tracer:
    return Tracer(mesh, size, QUALITY, packets=True)


def render(bodies: Bodies, job: Job, index: int) -> Entry:
    """Draw an entry, and trace it.

    Raises:
        ValueError: if a file cannot be used.
        RuntimeError: if no attempt gave an object that covers enough of the picture.
    """
    description = job.description
    failures: list[dict[str, Any]] = []
    for attempt in range(_TRIES):
        rng = generator(description.seed, description.split, "entry", index, attempt)
        shape = bodies.of_entry(index, attempt)
        body = bodies.mesh(shape)
        mesh = deformed(body, rng)
        pose = framed(rng, mesh, description.size)
        # A quarter of the bodies are not deformed.
        tracer = bodies.tracer(shape) if mesh is body else _tracer(mesh, description.size)
        gbuffer = tracer.trace(pose.rotation, pose.translation, pose.camera)
        coverage = gbuffer.coverage.mean()
        if coverage >= LEAST_COVERAGE:
            data = geometry.encode(*quantised(gbuffer, pose.camera))
            return Entry(data, shape, pose.camera, failures)
        error = f"the object covers {coverage:.1%} of the image"
        failures.append(
            {"index": index, "attempt": attempt, "shape": bodies.names[shape], "error": error}
        )
    raise RuntimeError(
        f"entry {index} of seed {description.seed} failed {_TRIES} times, last with "
        f"{failures[-1]['shape']}: {failures[-1]['error']}; try another --seed"
    )


def framed(rng: np.random.Generator, mesh: Mesh, size: int) -> Pose:
    """Draw the pose of an object, and a crop that at times cuts it."""
    pose = sample_pose(rng, mesh.vertices, size, FILL)
    if rng.random() >= CUT:
        return pose
    camera = pose.camera.copy()
    camera[2:] += rng.uniform(-_FARTHEST_CUT, _FARTHEST_CUT, 2) * size * FILL[1]
    return dataclasses.replace(pose, camera=camera)


def quantised(gbuffer: GBuffer, camera: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return a G-buffer as a bank holds it: coverage, share, normals, spread (`geometry.encode`).

    Every normal faces the viewer, as seen from the middle of its pixel.
    """
    size = len(gbuffer.coverage)
    pixels = gbuffer.covered_pixels
    view = view_directions(camera, size, size).reshape(-1, 3)[pixels]
    coverage, share = np.zeros(size * size, np.uint8), np.full(size * size, 255, np.uint8)
    coverage[pixels] = np.maximum(np.round(gbuffer.coverage.ravel()[pixels] * 255), 1)
    normals = np.stack([gbuffer.normal[gbuffer.central]] * 2)
    variance = np.stack([gbuffer.spread] * 2)
    two = parted(gbuffer)
    normals[:, two.rows], variance[:, two.rows] = two.normal, two.variance
    share[pixels[two.rows]] = np.clip(np.round(two.share * 255), 1, 254)
    normal = np.zeros((2, size * size, 2), np.uint16)
    spread = np.zeros((2, size * size), np.uint8)
    for surface, rows in enumerate((np.arange(len(pixels)), two.rows)):
        there = normals[surface][rows]
        there = lifted(there / np.linalg.norm(there, axis=-1, keepdims=True), view[rows])
        if surface:  # its codes are coarse
            there = lifted(there, view[rows], _LEAST_COSINE_OF_COARSE_CODES)
        normal[surface, pixels[rows]] = octahedral.encode(there)
        spread[surface, pixels[rows]] = geometry.spread_code(variance[surface][rows])
    square = (size, size)
    return (
        coverage.reshape(square),
        share.reshape(square),
        normal.reshape(2, *square, 2),
        spread.reshape(2, *square),
    )
