"""Random shapes: every family is drawn, closed, outwards, and what its name says."""

import collections

import numpy as np
import pytest
import trimesh
from mesh_checks import (
    check,
    faces_by_position,
    flat_normals,
    is_balanced,
    is_closed,
    share_on_the_side_of_the_normals,
    volume,
)

from lime_keras.render.shapes import endless, meshes
from lime_keras.render.shapes.meshes import Mesh

BALL = 4 / 3 * np.pi
THIN = ("frame", "tubes", "chains", "cages", "branches")
SEEDS = range(4)


def drawn(family, seed):
    return endless.FAMILIES[family][1](np.random.default_rng(seed))


def sound(mesh):
    check(mesh)
    assert is_balanced(mesh)
    assert volume(mesh) > 1e-4
    assert share_on_the_side_of_the_normals(mesh) > 0.96
    assert meshes.may_cover(mesh, 0.02)


@pytest.mark.parametrize("family", endless.FAMILIES)
def test_a_family_is_closed_and_faces_outwards(family):
    for seed in SEEDS:
        sound(drawn(family, seed))


@pytest.mark.parametrize("family", THIN)
def test_thin_families_fill_little_of_their_sphere(family):
    shares = [volume(drawn(family, seed)) / BALL for seed in SEEDS]
    assert np.median(shares) < 0.1


def test_shares_are_those_that_are_stated(monkeypatch):
    names = collections.Counter()
    point = Mesh(np.eye(3, dtype="f4"), np.array([[0, 1, 2]], "u4"), np.eye(3, dtype="f4"))

    def stand_in(name):
        def make(rng):
            names[name] += 1
            return point

        return make

    families = {name: (share, stand_in(name)) for name, (share, _) in endless.FAMILIES.items()}
    monkeypatch.setattr(endless, "FAMILIES", families)
    rng = np.random.default_rng(0)
    for _ in range(4000):
        endless.endless(rng)
    assert sum(share for share, _ in families.values()) == pytest.approx(1)
    for name, (share, _) in families.items():
        assert names[name] / 4000 == pytest.approx(share, abs=0.02)
        assert names[name]


def test_shapes_are_a_function_of_the_generator_and_go_on():
    rng, again = np.random.default_rng(7), np.random.default_rng(7)
    seen = set()
    for _ in range(6):
        mesh, same = endless.endless(rng), endless.endless(again)
        for one, other in zip(vars(mesh).values(), vars(same).values(), strict=True):
            np.testing.assert_array_equal(one, other)
        seen.add(mesh.vertices.tobytes())
    assert len(seen) == 6


@pytest.fixture(scope="module")
def listed():
    return [endless.procedural(np.random.default_rng(seed)) for seed in range(16)]


@pytest.mark.parametrize("seed", range(16))
def test_listed_shapes_are_closed_in_one_piece_and_face_outwards(listed, seed):
    mesh = listed[seed]
    check(mesh)
    assert 5_000 <= len(mesh.faces) <= 40_000
    assert is_closed(mesh)
    assert volume(mesh) > 1e-3
    side = (flat_normals(mesh)[:, None] * mesh.normals[mesh.faces]).sum(-1)
    assert (side > 0).mean() > 0.98
    faces = faces_by_position(mesh)
    joined = trimesh.Trimesh(np.zeros((faces.max() + 1, 3)), faces, process=False)
    labels = trimesh.graph.connected_component_labels(joined.edges, node_count=faces.max() + 1)
    assert labels.max() == 0


def test_shapes_vary_from_round_to_thin_and_from_smooth_to_creased(listed):
    volumes = np.array([volume(mesh) for mesh in listed]) / (4 / 3 * np.pi)
    assert volumes.min() < 0.1 and volumes.max() > 0.3
    creased = [len(np.unique(m.vertices, axis=0)) < len(m.vertices) for m in listed]
    assert 0.1 < np.mean(creased) < 0.6
