"""Masks of networks from elsewhere: tiny ONNX files stand for them."""

import numpy as np
import onnx
import onnx_files
import onnxruntime
import pytest
from onnx import TensorProto, helper
from PIL import Image

from lime_keras.runtime.masker import FAMILIES, Masker

FLOAT = TensorProto.FLOAT


def write(path, nodes, inputs=None, outputs=None, kind=FLOAT):
    """Write a network of `nodes` from `image` to `mask`."""
    inputs = inputs or {"image": [1, 3, 8, 8]}
    outputs = {"mask": [1, 1, None, None]} if outputs is None else outputs
    onnx.save(onnx_files.made(nodes, inputs, outputs, kind=kind), path)
    return path


def mean(out="mask"):
    return helper.make_node("ReduceMean", ["image"], [out], axes=[1], keepdims=1)


SIGMOID = (mean("logits"), helper.make_node("Sigmoid", ["logits"], ["mask"]))


def seen_mean(image, family, size=8):
    """The mean of a picture's channels as a family's network sees it."""
    about = FAMILIES[family]
    levels = Image.fromarray((image * 255).round().astype(np.uint8))
    small = np.asarray(levels.resize((size, size), Image.Resampling.BILINEAR), np.float64) / 255
    if about.by_maximum:
        small = small / small.max()
    return ((small - about.mean) / about.deviation).mean(-1)


@pytest.fixture
def image():
    return np.random.default_rng(0).uniform(0, 0.8, (8, 8, 3)).astype(np.float32)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_network_sees_the_photo_as_its_family_does(family, image, tmp_path):
    """Both answers, coverage and its logits, are the same mask."""
    expected = 1 / (1 + np.exp(-seen_mean(image, family)))
    for nodes in (SIGMOID, [mean()]):
        found = Masker(write(tmp_path / "m.onnx", nodes), family)(image)
        assert found.shape == (8, 8, 1) and found.dtype == np.float32
        np.testing.assert_allclose(found[..., 0], expected, atol=1e-5)


def test_the_mask_has_the_photos_size_and_place(tmp_path):
    masker = Masker(write(tmp_path / "m.onnx", [mean()]), "isnet")
    image = np.zeros((50, 130, 3), np.float32)
    image[:, 65:] = 1
    found = masker(image)[..., 0]
    assert found.shape == (50, 130)
    assert (found[:, :50] < 0.4).all() and (found[:, -50:] > 0.6).all()


def test_a_file_that_leaves_its_size_open_gets_its_familys(tmp_path):
    """The network answers its height."""
    nodes = [
        helper.make_node("Shape", ["image"], ["shape"], start=2, end=3),
        helper.make_node("Cast", ["shape"], ["height"], to=FLOAT),
        helper.make_node("Constant", [], ["scale"], value_floats=[1e-4, 1e-4]),
        helper.make_node("Mul", ["height", "scale"], ["pair"]),
        helper.make_node("Constant", [], ["form"], value_ints=[1, 1, 1, 2]),
        helper.make_node("Reshape", ["pair", "form"], ["mask"]),
    ]
    path = write(tmp_path / "m.onnx", nodes, {"image": ["batch", 3, "h", "w"]})
    for family, about in FAMILIES.items():
        found = Masker(path, family)(np.zeros((4, 4, 3), np.float32))
        np.testing.assert_allclose(found, about.size * 1e-4, rtol=1e-5)


def test_half_precision_is_taken(image, tmp_path):
    path = write(tmp_path / "m.onnx", SIGMOID, kind=TensorProto.FLOAT16)
    found = Masker(path)(image)[..., 0]
    np.testing.assert_allclose(found, 1 / (1 + np.exp(-seen_mean(image, "u2net"))), atol=2e-3)


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_photos_of_one_level_are_masked(level, tmp_path):
    masker = Masker(write(tmp_path / "m.onnx", SIGMOID))
    found = masker(np.full((1, 30, 3), level, np.float32))
    assert found.shape == (1, 30, 1) and np.ptp(found) < 1e-6 and 0 <= found.min() <= 1


def test_the_first_of_several_outputs_is_the_mask(image, tmp_path):
    nodes = [*SIGMOID, helper.make_node("Neg", ["mask"], ["coarse"])]
    outputs = {"mask": [1, 1, 8, 8], "coarse": [1, 1, 8, 8]}
    found = Masker(write(tmp_path / "m.onnx", nodes, outputs=outputs))(image)[..., 0]
    np.testing.assert_allclose(found, 1 / (1 + np.exp(-seen_mean(image, "u2net"))), atol=1e-4)


def test_what_is_no_network_is_refused_by_name(tmp_path):
    with pytest.raises(ValueError, match=r"none\.onnx is no file: .* none is downloaded"):
        Masker(tmp_path / "none.onnx")
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(ValueError, match=r"text\.onnx cannot be opened as an ONNX network: "):
        Masker(tmp_path / "text.onnx")
    with pytest.raises(ValueError, match="no family 'sam' of maskers: choose from u2net"):
        Masker(tmp_path / "text.onnx", "sam")


@pytest.mark.parametrize(
    "inputs", [{"image": [1, 8, 8, 3]}, {"image": [3, 8]}, {"image": [1, 3, 8, 8], "more": [1]}]
)
def test_a_network_of_something_else_is_refused(inputs, tmp_path):
    nodes = [helper.make_node("Identity", ["image"], ["mask"])]
    path = write(tmp_path / "m.onnx", nodes, inputs, {"mask": None})
    with pytest.raises(ValueError, match=r"m\.onnx takes .* a masker takes one picture \(1, 3, "):
        Masker(path)


@pytest.mark.parametrize("edge", [0, 5000])
def test_a_picture_of_no_size_or_of_a_hall_is_refused(edge, tmp_path):
    nodes = [helper.make_node("Identity", ["image"], ["mask"])]
    path = write(tmp_path / "m.onnx", nodes, {"image": [1, 3, 8, edge]}, {"mask": None})
    with pytest.raises(ValueError, match=rf"m\.onnx takes pictures of {edge}×8 pixels, and"):
        Masker(path)


def test_a_network_that_answers_nothing_is_refused(tmp_path):
    path = write(tmp_path / "m.onnx", SIGMOID, outputs={})
    with pytest.raises(ValueError, match=r"m\.onnx answers nothing, and a masker answers a mask"):
        Masker(path)


ANSWERS = {
    "no mask": ([helper.make_node("Identity", ["image"], ["mask"])], r"answers \(1, 3, 8, 8\)"),
    "a number": (
        [helper.make_node("ReduceMean", ["image"], ["mask"], keepdims=0)],
        r"answers \(\) first, and a masker",
    ),
    "not a number": (
        [
            mean("some"),
            helper.make_node("Sub", ["some", "some"], ["none"]),
            helper.make_node("Div", ["none", "none"], ["mask"]),
        ],
        "answers NaN or infinity",
    ),
}


@pytest.mark.parametrize(("nodes", "told"), ANSWERS.values(), ids=ANSWERS)
def test_an_answer_that_is_no_mask_is_refused(nodes, told, image, tmp_path):
    masker = Masker(write(tmp_path / "m.onnx", nodes, outputs={"mask": None}))
    with pytest.raises(ValueError, match=rf"m\.onnx {told}"):
        masker(image)


def test_a_network_that_fails_is_told_by_name(image, tmp_path):
    nodes = [
        helper.make_node("Constant", [], ["form"], value_ints=[1, 7]),
        helper.make_node("Reshape", ["image", "form"], ["mask"]),
    ]
    path = write(tmp_path / "m.onnx", nodes, {"image": [1, 3, "h", "w"]}, {"mask": None})
    onnxruntime.set_default_logger_severity(4)
    masker = Masker(path)
    with pytest.raises(ValueError, match=r"m\.onnx fails on a picture \(1, 3, 320, 320\): "):
        masker(image)
