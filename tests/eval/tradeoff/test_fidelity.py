"""Whose errors a variant has: Keras' where the answers are Keras', else its own."""

from types import SimpleNamespace

import numpy as np
import pytest

from lime_keras.eval.store import Store
from lime_keras.eval.tradeoff import fidelity
from lime_keras.eval.tradeoff.fidelity import Fidelity
from lime_keras.eval.tradeoff.runtimes import KERAS, ONNX, SAVED_MODEL
from lime_keras.export import parity


class StandIn:
    """A run that answers every image with a number of its runtime and precision."""

    name, folder, image_size = "run", "folder", 8
    depends_on = {"weights": "abc"}  # noqa: RUF012

    def __init__(self, images, answers):
        self._answers = answers
        self.samples = SimpleNamespace(
            corpus="corpus",
            camera=False,
            test=lambda size: images,
            depends_on=lambda split: {"split": split, "camera": self.samples.camera},
        )

    def answer(self, runtime, precision):
        return lambda images: {
            "mask": np.full((len(images), 1), self._answers[runtime, precision]),
            "mirror": np.full((len(images), 1), 100 * self._answers[runtime, precision]),
        }


@pytest.fixture
def evaluated(monkeypatch):
    """Answers that were evaluated on the test split, in order."""
    answers = []

    def evaluate(folder, corpus, *, camera, answer):
        answers.append(float(answer(np.zeros((1, 8, 8, 3)))["mask"][0, 0]))
        return answers[-1]

    def summarise(answer):
        interval = {"mask_iou": [answer - 1, answer + 1]}
        chance = {"mask_iou": 0.25}
        return {"mask_iou": answer, "interval": interval, "chance": chance, "count": 7}

    monkeypatch.setattr(fidelity, "evaluate", evaluate)
    monkeypatch.setattr(fidelity.measures, "summarise", summarise)
    return answers


@pytest.fixture
def images(tmp_path):
    np.save(tmp_path / "images.npy", np.zeros((40, 8, 8, 3), np.float32))
    return tmp_path / "images.npy"


def _fidelity(tmp_path, images, **of_onnx):
    answers = {(KERAS, name): 0.5 + i for i, name in enumerate(("float32", "bfloat16", "float16"))}
    answers |= {(SAVED_MODEL, name): value for (_, name), value in answers.items()}
    answers |= {(ONNX, name): value for name, value in of_onnx.items()}
    return Fidelity(StandIn(images, answers), Store(tmp_path / "store"))


def test_the_difference_is_from_keras_in_the_same_precision(tmp_path, images):
    of = _fidelity(tmp_path, images, float16=2.75, int8=1.5)
    assert of.difference(ONNX, "float16") == pytest.approx({"mask": 0.25 / 2.5, "mirror": 0.1})
    # Keras has no eight bits: float32 stands in, whose mirror is 50.
    assert of.difference(ONNX, "int8") == pytest.approx({"mask": 1.0, "mirror": 2.0})
    assert set(of.difference(SAVED_MODEL, "bfloat16").values()) == {0}


@pytest.mark.parametrize("apart", [0.0, 0.9 * parity.TOLERANCE, -0.9 * parity.TOLERANCE])
def test_answers_that_are_keras_have_its_errors(tmp_path, images, evaluated, apart):
    of = _fidelity(tmp_path, images, float32=0.5 * (1 + apart))
    expected = {
        "measured_on": KERAS,
        "errors": {"mask_iou": 0.5},
        "interval": {"mask_iou": [-0.5, 1.5]},
        "chance": {"mask_iou": 0.25},
        "count": 7,
    }
    assert of.errors(ONNX, "float32") == of.errors(KERAS, "float32") == expected
    assert evaluated == [0.5]


@pytest.mark.parametrize("apart", [1.1 * parity.TOLERANCE, -1.1 * parity.TOLERANCE])
def test_answers_of_their_own_are_evaluated(tmp_path, images, evaluated, apart):
    of = _fidelity(tmp_path, images, float32=0.5 * (1 + apart), int8=0.5)
    assert of.errors(ONNX, "float32")["measured_on"] == ONNX
    # Eight bits are Keras' answer only by accident.
    assert of.errors(ONNX, "int8")["measured_on"] == ONNX
    assert evaluated == [0.5 * (1 + apart), 0.5]


def test_what_is_known_is_not_evaluated_again(tmp_path, images, evaluated):
    for _ in range(2):
        of = _fidelity(tmp_path, images, float32=0.5, int8=0.25)
        for runtime, precision in ((KERAS, "float32"), (ONNX, "float32"), (ONNX, "int8")):
            of.errors(runtime, precision)
    assert evaluated == [0.5, 0.25]
    other = _fidelity(tmp_path, images, int8=0.125)
    other._run.samples.camera = True
    assert other.errors(ONNX, "int8")["errors"] == {"mask_iou": 0.125}
