"""Rooms: what is drawn stands inside the walls and leaves the viewpoint clear."""

import pickle

import numpy as np
import pytest

from lime_keras.render.rooms import random_room


@pytest.mark.parametrize("seed", range(16))
def test_viewpoint_is_clear_and_everything_stands_in_the_room(seed):
    room = random_room.sample(np.random.default_rng(seed))
    eye, size = np.array(room.viewpoint), np.array(room.size)
    assert (np.abs(eye[[0, 2]]) < size[[0, 2]] / 2 - 0.4).all() and 0.4 < eye[1] < size[1] - 0.4
    solids = [*room.solids, *(solid for light in room.lights for solid in light.solids)]
    for solid in solids:
        vertices = solid.vertices
        assert np.linalg.norm(vertices - eye, axis=1).min() > 0.2
        assert not ((vertices.min(0) < eye) & (eye < vertices.max(0))).all()
        assert (np.abs(vertices[:, [0, 2]]) < size[[0, 2]] / 2 + 0.01).all()
        assert vertices[:, 1].min() > -0.01 and vertices[:, 1].max() < size[1] + 0.01
    assert 1 <= len(room.lights) <= random_room.LIGHTS


def test_sample_is_a_function_of_the_generator():
    rooms = [random_room.sample(np.random.default_rng(k)) for k in (5, 5, 6)]
    first, again, other = map(pickle.dumps, rooms)
    assert first == again != other
