"""What a process of its own says, and how rounds of it are pooled."""

import math
import subprocess
import sys

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from lime_keras.eval.tradeoff import runtimes, timing
from lime_keras.eval.tradeoff.timing import Effort, Job

QUICK = Effort(warm_up=2, seconds=0.01, least=3, most=20)


@pytest.fixture
def model(tmp_path):
    """ONNX file that doubles an image."""
    shape = ["batch", 4, 4, 3]
    graph = helper.make_graph(
        [helper.make_node("Add", ["image", "image"], ["mask"])],
        "double",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("mask", TensorProto.FLOAT, shape)],
    )
    path = tmp_path / "double.onnx"
    opset = [helper.make_opsetid("", 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=8), path)
    return path


def _job(path, images=None, **changes):
    job = {"runtime": runtimes.ONNX, "precision": "float32", "path": str(path), "batch": 5}
    return Job(**job | {"threads": 1, "images": images, "effort": QUICK} | changes)


def _is_sane(measured, effort):
    assert effort.least <= len(measured["seconds"]) <= effort.most
    assert all(0 < seconds < 60 for seconds in measured["seconds"])
    parts = [measured[f"{part}_s"] for part in ("import", "load", "first")]
    assert all(part > 0 for part in parts)
    # The interpreter's own start is no part of them.
    assert sum(parts) < measured["cold_start_s"]
    assert measured["busy"] > 0


def test_an_onnx_process_answers_for_itself_alone(model):
    """Noise into inputs of any name; the parent's memory is not counted as the child's."""
    held = np.ones(2**28, np.uint8)
    held[:] = 2
    measured = timing.measure(_job(model))
    _is_sane(measured, QUICK)
    assert 10 < measured["peak_memory_mib"] < held.nbytes / 2**20


@pytest.mark.slow
def test_a_keras_process_answers_images_in_half_precision(tiny_model, tmp_path):
    np.save(tmp_path / "images.npy", np.full((2, 32, 32, 3), 0.5, np.float32))
    images = str(tmp_path / "images.npy")
    job = _job(tiny_model, images, runtime=runtimes.KERAS, precision="bfloat16")
    _is_sane(timing.measure(job), QUICK)


def test_a_process_that_fails_says_why(tmp_path):
    with pytest.raises(RuntimeError, match=r"missing\.onnx cannot be timed under ONNX.*doesn't ex"):
        timing.measure(_job(tmp_path / "missing.onnx"))


def test_onnx_runtime_is_opened_without_tensorflow(model):
    code = (
        "import sys, numpy\n"
        "from pathlib import Path\n"
        "from lime_keras.eval.tradeoff import runtimes, timing\n"
        f"answer = runtimes.open_answer(runtimes.ONNX, Path({str(model)!r}), 'float32', 1)\n"
        "images = numpy.ones((2, 4, 4, 3), numpy.float32)\n"
        "assert (answer(images)['mask'] == 2).all()\n"
        "assert not {'tensorflow', 'keras', 'onnx', 'matplotlib'} & set(sys.modules)\n"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr


@pytest.mark.parametrize(
    ("effort", "calls"),
    [
        (Effort(seconds=0, least=4, most=9), 4),
        (Effort(seconds=math.inf, least=4, most=9), 9),
        (Effort(seconds=0, least=9, most=4), 4),
    ],
)
def test_the_effort_bounds_the_calls(effort, calls):
    made = []
    seconds, busy = timing._repeated(lambda: made.append(1), effort)
    assert len(made) == len(seconds) == calls and busy >= 0


def test_a_batch_larger_than_the_images_repeats_them(model, tmp_path):
    images = np.arange(2 * 48, dtype=np.float32).reshape(2, 4, 4, 3)
    np.save(tmp_path / "images.npy", images)
    answer = timing._prepared(_job(model, str(tmp_path / "images.npy")))()
    np.testing.assert_array_equal(answer["mask"], 2 * images[[0, 1, 0, 1, 0]])


def test_rounds_are_pooled_by_hand():
    rounds = [
        {
            "seconds": [0.1, 0.2, 0.3],
            "cold_start_s": 3.0,
            "import_s": 1.0,
            "load_s": 0.5,
            "first_s": 0.25,
            "busy": 1.5,
            "peak_memory_mib": 100,
        },
        {
            "seconds": [0.4, 0.5],
            "cold_start_s": 5.0,
            "import_s": 1.0,
            "load_s": 1.5,
            "first_s": 0.75,
            "busy": 0.5,
            "peak_memory_mib": 120,
        },
    ]
    assert timing.pooled(rounds, batch=8) == pytest.approx(
        {
            "latency_ms": 300,
            "p95_ms": 480,
            "samples": 5,
            "images_per_second": 8 * 5 / 1.5,
            "spread": (0.45 - 0.2) / 0.3,
            "cold_start_ms": 4000,
            "import_ms": 1000,
            "load_ms": 1000,
            "first_ms": 500,
            "busy": 1.0,
            "peak_memory_mib": 120,
        }
    )
