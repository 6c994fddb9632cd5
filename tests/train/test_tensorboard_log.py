"""TensorBoard's files hold what was written."""

import importlib.util

import tensorflow as tf
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from lime_keras.train.tensorboard_log import Board


def test_scalars_are_read_back_by_tensorboard(tmp_path):
    board = Board(tmp_path)
    for step in (5, 10):
        board.scalars(step, {"validation": {"mask": step / 10}, "gradient norm": {"mirror": 3.0}})
    board.close()
    events = EventAccumulator(str(tmp_path), size_guidance={"tensors": 0}).Reload()
    found = {
        name: [
            (event.step, float(tf.make_ndarray(event.tensor_proto)))
            for event in events.Tensors(name)
        ]
        for name in events.Tags()["tensors"]
    }
    assert found["gradient norm/mirror"] == [(5, 3.0), (10, 3.0)]
    assert found["validation/mask"] == [(5, 0.5), (10, 1.0)]


def test_without_tensorboard_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    board = Board(tmp_path / "board")
    board.scalars(1, {"validation": {"mask": 0.5}})
    board.close()
    assert not list(tmp_path.iterdir())


def test_a_second_board_keeps_the_firsts_events(tmp_path):
    for step in (1, 2):
        board = Board(tmp_path)
        board.scalars(step, {"validation": {"mask": 0.5}})
        board.close()
    events = EventAccumulator(str(tmp_path), size_guidance={"tensors": 0}).Reload()
    assert [event.step for event in events.Tensors("validation/mask")] == [1, 2]
