"""A model's files, opened in the runtime that they are for: the cost of each is its own.

Nothing is imported here before it is needed, so that a process that runs ONNX Runtime holds no
TensorFlow, nor the other way round.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lime_keras.arrays import Answer

if TYPE_CHECKING:
    import onnxruntime

KERAS, SAVED_MODEL, ONNX = "Keras", "SavedModel", "ONNX Runtime"


def open_answer(runtime: str, path: Path, precision: str, threads: int | None = None) -> Answer:
    """Load a model; what is called with images then answers as the assembled system does.

    Args:
        runtime: `KERAS`, `SAVED_MODEL` or `ONNX`.
        path: folder of `lime_keras.networks.weights.save`, of a SavedModel, or ONNX file.
        precision: a name of `precision.POLICIES`, for Keras; the other files hold theirs.
        threads: for ONNX Runtime; by default all. TensorFlow's are its process's.
    """
    if runtime == KERAS:
        return _keras(path, precision)
    if runtime == SAVED_MODEL:
        return _saved_model(path)
    return _onnx(path, threads)


def start_tensorflow(threads: int) -> None:
    """Import TensorFlow and start it with so many threads, one operation at a time.

    Raises:
        RuntimeError: if it was started before.
    """
    import tensorflow as tf

    tf.config.threading.set_intra_op_parallelism_threads(threads)
    # As ONNX Runtime does it.
    tf.config.threading.set_inter_op_parallelism_threads(1)
    tf.constant(0)


def session(path: Path, threads: int | None = None) -> "onnxruntime.InferenceSession":
    """An ONNX model under ONNX Runtime on the processor, with its own way of waiting for work."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads or 0
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def _keras(folder: Path, precision: str) -> Answer:
    from lime_keras.networks import assemble, weights
    from lime_keras.networks.precision import computing_in

    with computing_in(precision):
        _, subnetworks = weights.load(folder)
    return assemble(subnetworks).predict_on_batch


def _saved_model(path: Path) -> Answer:
    import tensorflow as tf

    # The signature alone does not keep the loaded model, and its variables, alive.
    loaded = tf.saved_model.load(str(path))

    def answer(images: np.ndarray) -> dict[str, np.ndarray]:
        served = loaded.signatures["serving_default"](image=tf.constant(images))
        return {name: value.numpy() for name, value in served.items()}

    return answer


def _onnx(path: Path, threads: int | None) -> Answer:
    opened = session(path, threads)
    names = [output.name for output in opened.get_outputs()]

    def answer(images: np.ndarray) -> dict[str, np.ndarray]:
        return dict(zip(names, opened.run(names, {"image": images}), strict=True))

    return answer
