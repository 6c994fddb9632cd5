"""The page's graphs give the merged model's numbers."""

import live_scenes
import numpy as np
import onnxruntime
import pytest

from lime_keras.live import page_graphs
from lime_keras.model import folder as model_folder
from lime_keras.runtime import onnx_graphs

SHIPPED = model_folder.graphs(model_folder.DEFAULT)
SIZE = 128
NAMES = "mask", "material", "layers"


@pytest.fixture(scope="module")
def engine():
    return onnx_graphs.open_folder(SHIPPED)


@pytest.fixture(scope="module")
def pictures():
    """Balls of three sizes."""
    balls = [live_scenes.ball(SIZE, SIZE, radius=radius) for radius in (0.5, 0.7, 0.9)]
    return np.stack(balls) / np.float32(255)


@pytest.fixture(scope="module")
def written(engine, tmp_path_factory):
    folder = tmp_path_factory.mktemp("graphs")
    assert page_graphs.write(folder, SHIPPED, engine.description) == NAMES
    return folder


def opened(written, name):
    path = written / f"{name}.onnx"
    return onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])


def run(session, fed):
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, fed), strict=True))


def test_they_take_one_image_and_answer_all(written, engine):
    """The layers that only pictures and the light need are in a graph of their own."""
    mask, material, layers = (opened(written, name) for name in NAMES)
    image, layer = [1, SIZE, SIZE, 3], [1, SIZE, SIZE, 1]
    between = {"compressed_specular_shading": layer}
    assert {x.name: x.shape for x in mask.get_inputs()} == {"image": image}
    assert {x.name: x.shape for x in material.get_inputs()} == {"image": image, "mask": layer}
    assert {x.name: x.shape for x in layers.get_inputs()} == {"mask": layer} | between
    answered = [{output.name for output in one.get_outputs()} for one in (mask, material, layers)]
    assert answered[0] == {"mask"} and answered[2] == {"mirror"}
    assert answered[1] == {*engine.outputs, *between} - {"mask", "mirror"}


def test_they_give_the_merged_models_numbers(written, engine, pictures):
    """To the last bit; for the mask that was found, and for one that was given."""
    mask, material, layers = (opened(written, name) for name in NAMES)
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
            answer = run(material, fed)
            between = answer.pop("compressed_specular_shading")
            gather(found, answer)
            gather(found, run(layers, {"mask": given, "compressed_specular_shading": between}))
            gather(expected, engine.run([x for x in engine.outputs if x != "mask"], fed))
    assert found.keys() == expected.keys() == set(engine.outputs)
    for name in found:
        value, true = np.stack(found[name]), np.stack(expected[name])
        np.testing.assert_array_equal(value, true, err_msg=name)


def gather(stacks, answers):
    for name, value in answers.items():
        stacks.setdefault(name, []).append(value)
