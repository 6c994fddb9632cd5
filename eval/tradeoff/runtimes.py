"""The runtimes, and the loading of a model in each of them.

Each runtime is imported only when it is needed. A process that runs ONNX Runtime therefore does not
load TensorFlow, nor the other way round, and its start and memory are those of its runtime.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lime_keras.arrays import Predict

if TYPE_CHECKING:
    import onnxruntime

KERAS, SAVED_MODEL, ONNX = "Keras", "SavedModel", "ONNX Runtime"


def open_answer(runtime: str, path: Path, precision: str, threads: int | None = None) -> Predict:
    """Load a model, and return the function from images to the outputs of the assembled system.

    Args:
        runtime: `KERAS`, `SAVED_MODEL` or `ONNX`.
        path: folder of `lime_keras.model.weights.save`, folder of a SavedModel, or ONNX file.
        precision: name out of `precision.POLICIES` for Keras; the files of the other runtimes hold
            their precision.
        threads: number of threads for ONNX Runtime; by default all. For TensorFlow it is set for
            the whole process (see `start_tensorflow`).
    """
    if runtime == KERAS:
        return _keras(path, precision)
    if runtime == SAVED_MODEL:
        return _saved_model(path)
    return _onnx(path, threads)


def start_tensorflow(threads: int) -> None:
    """Import TensorFlow and start it with `threads` threads, one operation at a time.

    Raises:
        RuntimeError: if TensorFlow was started before.
    """
    import tensorflow as tf

    tf.config.threading.set_intra_op_parallelism_threads(threads)
    # ONNX Runtime also runs one operation at a time.
    tf.config.threading.set_inter_op_parallelism_threads(1)
    tf.constant(0)


def session(path: Path, threads: int | None = None) -> "onnxruntime.InferenceSession":
    """Load an ONNX model in ONNX Runtime on the CPU.

    Args:
        path: ONNX file.
        threads: number of threads; by default all.
    """
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads or 0
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def _keras(folder: Path, precision: str) -> Predict:
    from lime_keras.model import weights
    from lime_keras.networks import assemble
    from lime_keras.networks.precision import computing_in

    with computing_in(precision):
        _, subnetworks = weights.load(folder)
    return assemble(subnetworks).predict_on_batch


def _saved_model(path: Path) -> Predict:
    import tensorflow as tf

    # The signature alone does not keep the loaded model and its variables in memory.
    loaded = tf.saved_model.load(str(path))

    def answer(images: np.ndarray) -> dict[str, np.ndarray]:
        served = loaded.signatures["serving_default"](image=tf.constant(images))
        return {name: value.numpy() for name, value in served.items()}

    return answer


def _onnx(path: Path, threads: int | None) -> Predict:
    opened = session(path, threads)
    names = [output.name for output in opened.get_outputs()]

    def answer(images: np.ndarray) -> dict[str, np.ndarray]:
        return dict(zip(names, opened.run(names, {"image": images}), strict=True))

    return answer
