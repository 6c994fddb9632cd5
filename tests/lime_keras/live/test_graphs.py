"""The page's two graphs give the merged model's numbers."""

import live_scenes
import numpy as np
import onnxruntime
import pytest

from lime_keras.live import graphs
from lime_keras.model import folder as model_folder
from lime_keras.runtime import onnx_graphs

SHIPPED = model_folder.graphs(model_folder.SHIPPED)
SIZE = 128


@pytest.fixture(scope="module")
def engine():
    return onnx_graphs.open_folder(SHIPPED)


@pytest.fixture(scope="module")
def pictures():
    """Balls of three sizes."""
    balls = [live_scenes.ball(SIZE, SIZE, radius=radius) for radius in (0.5, 0.7, 0.9)]
    return np.stack(balls) / np.float32(255)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("graphs")
    graphs.write(folder, SHIPPED)
    return folder


def opened(written, name):
    path = written / f"{name}.onnx"
    return onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])


def run(session, fed):
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, fed), strict=True))


def test_they_take_one_image_and_answer_all(written, engine):
    mask, material = (opened(written, name) for name in graphs.NAMES)
    image = [1, SIZE, SIZE, 3]
    assert {x.name: x.shape for x in mask.get_inputs()} == {"image": image}
    assert {x.name: x.shape for x in material.get_inputs()} == {
        "image": image,
        "mask": [1, SIZE, SIZE, 1],
    }
    answered = [output.name for one in (mask, material) for output in one.get_outputs()]
    assert tuple(answered) == engine.outputs


def test_they_give_the_merged_models_numbers(written, engine, pictures):
    """To the last bit; for the mask that was found, and for one that was given."""
    mask, material = (opened(written, name) for name in graphs.NAMES)
    painted = np.zeros((1, SIZE, SIZE, 1), np.float32)
    painted[:, 30:100, 40:90] = 1
    found, expected = {}, {}
    for picture in pictures:
        image = picture[None]
        masks = run(mask, {"image": image})
        gather(found, masks)
        gather(expected, engine.run(["mask"], {"image": image}))
        for given in (masks["mask"], painted):
            fed = {"image": image, "mask": given}
            gather(found, run(material, fed))
            gather(expected, engine.run([x for x in engine.outputs if x != "mask"], fed))
    assert found.keys() == expected.keys() == set(engine.outputs)
    for name in found:
        value, true = np.stack(found[name]), np.stack(expected[name])
        np.testing.assert_array_equal(value, true, err_msg=name)


def gather(stacks, answers):
    for name, value in answers.items():
        stacks.setdefault(name, []).append(value)


def test_no_graphs_are_told(tmp_path):
    with pytest.raises(ValueError, match="holds no graphs"):
        graphs.write(tmp_path, tmp_path)
