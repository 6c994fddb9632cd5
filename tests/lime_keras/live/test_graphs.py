"""The page's two graphs give the merged model's numbers; in eight bits, nearly."""

import numpy as np
import onnx
import onnxruntime
import pytest

from lime_keras.io import graph_folder, model_folder
from lime_keras.live import calibration, graphs
from lime_keras.optics import environment
from lime_keras.runtime.engine import OnnxEngine

SHIPPED = model_folder.graphs(model_folder.SHIPPED)
SIZE = 128


@pytest.fixture(scope="module")
def engine():
    return OnnxEngine(SHIPPED, graph_folder.read(SHIPPED))


@pytest.fixture(scope="module")
def pictures():
    """Three that calibrated nothing."""
    rng = np.random.default_rng(1)
    return np.stack([calibration._picture(rng, SIZE) for _ in range(3)]).astype(np.float32)


@pytest.fixture(scope="module", params=graphs.PRECISIONS)
def written(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibration, "COUNT", 16)
        graphs.write(folder, SHIPPED, request.param)
    return request.param, folder


def opened(written, name):
    precision, folder = written
    path = folder / f"{name}-{precision}.onnx"
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
    """In float32 to the last bit; for the mask that was found, and for one that was given."""
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
        if written[0] == "float32":
            np.testing.assert_array_equal(value, true, err_msg=name)
        else:
            assert np.mean(np.abs(value - true)) < 0.35 * np.mean(np.abs(true)), name


def gather(stacks, answers):
    for name, value in answers.items():
        stacks.setdefault(name, []).append(value)


def test_eight_bits_leave_the_last_layers(written):
    """All weights of int8 are eight-bit but those before an output; of float32 none is."""
    precision, folder = written
    for graph, lasts in (("mask", 1), ("material", 4)):
        model = onnx.load(folder / f"{graph}-{precision}.onnx").graph
        makers = {output: node.op_type for node in model.node for output in node.output}
        weighted = [node for node in model.node if node.op_type in graphs._WEIGHTED]
        narrow = [makers.get(node.input[1]) == "DequantizeLinear" for node in weighted]
        assert narrow.count(False) == (lasts if precision == "int8" else len(narrow))
        outputs = {output.name for output in model.output}
        assert not {makers[name] for name in outputs} & {"DequantizeLinear", "Concat"}


def test_no_graphs_are_told(tmp_path):
    with pytest.raises(ValueError, match="holds no graphs"):
        graphs.write(tmp_path, tmp_path, "float32")


@pytest.mark.parametrize("size", [8, 33])
def test_calibration_pictures_are_pictures(size):
    """Finite, in range, the same each time; dark and bright, of dull and of glossy objects."""
    pictures = calibration.pictures(size)
    assert pictures.shape == (calibration.COUNT, size, size, 3) and pictures.dtype == np.float32
    assert pictures.min() >= 0 and pictures.max() <= 1
    assert np.array_equal(pictures, calibration.pictures(size))
    brightness = pictures.mean((1, 2, 3))
    assert brightness.min() < 0.35 and brightness.max() > 0.55


def test_calibration_rooms_have_the_usual_exposure():
    rng = np.random.default_rng(0)
    for _ in range(20):
        room = calibration._room(rng)
        assert room.min() >= 0
        assert environment.spherical_mean(room) == pytest.approx(environment.MEAN_RADIANCE)


def test_calibration_domes_face_the_viewer():
    rng = np.random.default_rng(0)
    for _ in range(20):
        normal, inside = calibration._dome(rng, 24)
        assert normal.shape == (inside.sum(), 3) and inside.sum() > 50
        np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 1, atol=1e-6)
        assert normal[:, 2].min() >= 0
