"""Procedural shapes: closed, outwards, in one piece, varied."""

import numpy as np
import pytest
import trimesh
from mesh_checks import check, faces_by_position, flat_normals, is_closed, volume

from lime_keras.render.shapes import procedural

SEEDS = range(16)
FACES = (5_000, 40_000)


@pytest.fixture(scope="module")
def meshes():
    return [procedural.procedural(np.random.default_rng(seed)) for seed in SEEDS]


@pytest.mark.parametrize("seed", SEEDS)
def test_procedural_shapes_are_closed_in_one_piece_and_face_outwards(meshes, seed):
    mesh = meshes[seed]
    check(mesh)
    assert FACES[0] <= len(mesh.faces) <= FACES[1]
    assert is_closed(mesh)
    assert volume(mesh) > 1e-3
    side = (flat_normals(mesh)[:, None] * mesh.normals[mesh.faces]).sum(-1)
    assert (side > 0).mean() > 0.98
    faces = faces_by_position(mesh)
    joined = trimesh.Trimesh(np.zeros((faces.max() + 1, 3)), faces, process=False)
    labels = trimesh.graph.connected_component_labels(joined.edges, node_count=faces.max() + 1)
    assert labels.max() == 0


def test_shapes_vary_from_round_to_thin_and_from_smooth_to_creased(meshes):
    volumes = np.array([volume(mesh) for mesh in meshes]) / (4 / 3 * np.pi)
    assert volumes.min() < 0.1 and volumes.max() > 0.3
    creased = [len(np.unique(m.vertices, axis=0)) < len(m.vertices) for m in meshes]
    assert 0.1 < np.mean(creased) < 0.6
