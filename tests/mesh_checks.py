"""What every mesh must be: normalised, and if closed, closed and outside out."""

import numpy as np


def faces_by_position(mesh):
    """Faces over positions, so that vertices doubled along creases count as one."""
    _, position = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return position.reshape(-1)[mesh.faces.astype(int)]


def is_closed(mesh):
    """Whether every edge is run through as often one way as the other, and once."""
    faces = faces_by_position(mesh)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there = {(a, b) for a, b in edges.tolist()}
    return len(there) == len(edges) and all((b, a) in there for a, b in there)


def flat_normals(mesh):
    a, b, c = mesh.vertices[mesh.faces.astype(int)].astype(float).swapaxes(0, 1)
    return np.cross(b - a, c - a)


def volume(mesh):
    a, b, c = mesh.vertices[mesh.faces.astype(int)].astype(float).swapaxes(0, 1)
    return (np.cross(a, b) * c).sum() / 6


def check(mesh):
    assert mesh.vertices.dtype == np.float32 and mesh.vertices.shape[1:] == (3,)
    assert mesh.faces.dtype == np.uint32 and mesh.normals.shape == mesh.vertices.shape
    assert mesh.faces.max() < len(mesh.vertices)
    assert np.isfinite(mesh.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1).max(), 1, atol=1e-5)
    np.testing.assert_allclose(mesh.vertices.min(0), -mesh.vertices.max(0), atol=1e-5)
