"""Meshes of the surfaces of implicit fields."""

import numpy as np
from skimage.measure import marching_cubes
from trimesh.graph import connected_component_labels

from .fields import Field
from .meshes import Mesh, normalised

CELLS = 150_000  # cells of the grid for marching cubes: 8,000 to 30,000 faces, about 0.1 s


def polygonise(field: Field, radius: float, cells: int = CELLS) -> Mesh:
    """Return the mesh of a field's zero level inside a ball; its normals are the field's gradient.

    Args:
        field: the implicit field, negative inside.
        radius: radius of the ball around the origin.
        cells: number of cells of the grid for marching cubes.
    """
    low, high = _bounds(field, radius)
    step = (np.prod(high - low) / cells) ** (1 / 3)
    box = zip(low, high, strict=True)
    axes = [np.arange(a - 1.5 * step, b + 2 * step, step, dtype=np.float32) for a, b in box]
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
    return normalised(vertices, faces, _gradient(field, vertices.T, 0.25 * step).T)


def _bounds(field: Field, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper corner of a box that holds the surface, from a coarse grid."""
    axis = np.linspace(-radius, radius, 24, dtype=np.float32)
    inside = _sampled(field, [axis] * 3) < axis[1] - axis[0]
    reached = [np.flatnonzero(inside.any(axis=other)) for other in ((1, 2), (0, 2), (0, 1))]
    return axis[[r[0] for r in reached]], axis[[r[-1] for r in reached]]


def _sampled(field: Field, axes: list[np.ndarray]) -> np.ndarray:
    grid = np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")])
    return field(grid).reshape([len(axis) for axis in axes])


def _gradient(field: Field, p: np.ndarray, step: float) -> np.ndarray:
    """Return the direction of the field's gradient at points, by differences over a tetrahedron."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], np.float32)
    return sum(c[:, None] * field(p + np.float32(step) * c[:, None]) for c in corners)


def _largest_component(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest connected part of a mesh, without crumbs and cavities."""
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    label = connected_component_labels(edges, len(vertices))
    kept = label == np.bincount(label).argmax()
    return vertices[kept], (np.cumsum(kept) - 1)[faces[kept[faces[:, 0]]]]
