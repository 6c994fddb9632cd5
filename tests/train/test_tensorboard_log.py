"""TensorBoard's files hold what was written, and the pictures show truth beside answer."""

import importlib.util

import numpy as np
import pytest
import tensorflow as tf
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from lime_keras.train import terms
from lime_keras.train.tensorboard_log import Board, panel
from lime_keras.train.terms import StageAnswer


@pytest.fixture
def batch():
    mask = np.zeros((2, 4, 4, 1), np.float32)
    mask[:, 1:3, 1:3] = 1
    shading = np.full((2, 4, 4, 1), np.expm1(2.0), np.float32)
    return {
        "image": np.full((2, 4, 4, 3), 0.2, np.float32),
        "mask": mask,
        "specular_shading": shading,
        "mirror": shading,
    }


def test_scalars_are_read_back_by_tensorboard(tmp_path):
    board = Board(tmp_path)
    for step in (5, 10):
        board.scalars(step, {"held out": {"mask": step / 10}, "gradient norm": {"mirror": 3.0}})
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
    assert found["held out/mask"] == [(5, 0.5), (10, 1.0)]


def test_a_picture_is_written(tmp_path, batch):
    board = Board(tmp_path)
    board.panel(3, lambda batch: StageAnswer({}, {}, {"mask": batch["mask"]}), batch)
    board.close()
    events = EventAccumulator(str(tmp_path)).Reload()
    (event,) = events.Tensors("held out")
    width, height, png = event.tensor_proto.string_val
    assert (event.step, int(width), int(height)) == (3, 12, 8)
    assert png.startswith(b"\x89PNG")


def test_the_truth_stands_left_of_the_answer(batch):
    """Both up to the truth's maximum, black outside the mask."""
    mask = batch["mask"]
    outputs = {"specular_shading": mask * np.expm1(1.0), "mirror": 0 * mask}
    picture = panel(batch, outputs)
    assert picture.shape == (8, 5 * 4, 3) and picture.dtype == np.uint8
    image, true_s, found_s, true_m, found_m = np.split(picture[:4], 5, axis=1)
    assert (image == 51).all()
    assert (true_s[1:3, 1:3] == 255).all() and (true_s[0] == 0).all()
    assert (found_s[1:3, 1:3] == 128).all() and (found_s[0] == 0).all()
    assert (true_m == true_s).all() and (found_m == 0).all()


def test_what_is_no_number_is_magenta(batch):
    answer = {
        "mask": np.where(np.arange(4)[None, None, :, None] == 2, np.nan, np.zeros((2, 4, 4, 1)))
    }
    picture = panel(batch, answer)
    assert (picture[:, 10] == (255, 0, 255)).all()
    assert (picture[:, 11] == 0).all()


def test_a_stage_without_layers_shows_its_images(batch):
    assert panel(batch, {"exponent_bin_probabilities": np.zeros((2, 8))}).shape == (8, 4, 3)


def test_the_baseline_shows_its_spheres(batch, monkeypatch):
    sphere = np.full((2, 4, 4, 3), 0.5, np.float32)
    monkeypatch.setattr(terms, "truth", lambda name, batch: {"reflectance_map": sphere}[name])
    picture = panel(batch, {"reflectance_map": 0 * sphere})
    assert (picture[:, 4:8] == 255).all() and (picture[:, 8:] == 0).all()
    # MaterialNet alone predicts no layer.
    numbers = {"diffuse_albedo": np.zeros((2, 3)), "specular_albedo": np.zeros((2, 1))}
    assert panel(batch, numbers).shape == (8, 4, 3)


def test_without_tensorboard_nothing_is_written(tmp_path, batch, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    board = Board(tmp_path / "board")
    board.scalars(1, {"held out": {"mask": 0.5}})
    board.panel(1, lambda batch: StageAnswer({}, {}, {"mask": batch["mask"]}), batch)
    board.close()
    assert not list(tmp_path.iterdir())


def test_a_second_board_keeps_the_firsts_events(tmp_path):
    for step in (1, 2):
        board = Board(tmp_path)
        board.scalars(step, {"held out": {"mask": 0.5}})
        board.close()
    events = EventAccumulator(str(tmp_path), size_guidance={"tensors": 0}).Reload()
    assert [event.step for event in events.Tensors("held out/mask")] == [1, 2]
