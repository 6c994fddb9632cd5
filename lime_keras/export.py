"""SavedModel and ONNX, each proved to agree with Keras before it is called done."""

import gc
import shutil
from collections.abc import Collection
from pathlib import Path

import keras
import numpy as np
import tensorflow as tf

from lime_keras import weights
from lime_keras.networks import answers, assemble

TOLERANCE = 1e-3
"""Largest accepted difference from Keras: absolute, and relative for values above 1."""
_OPSET = 17


class ParityError(RuntimeError):
    """An exported model that does not answer as Keras does."""


def export(
    folder: Path,
    model_format: str,
    weights_folder: Path,
    only: Collection[str] | None = None,
) -> dict[str, float]:
    """Write a model and compare it with Keras on images it has never seen.

    Args:
        folder: written to: `saved_model/` or `lime.onnx` inside it.
        model_format: `savedmodel` or `onnx`.
        weights_folder: run of `lime-train`, or folder of `lime_keras.weights.save`.
        only: names of outputs, out of `lime_keras.networks.answers`; by default all that this
            model has.

    Returns:
        The largest difference from Keras of each output (relative above 1).

    Raises:
        FileNotFoundError: if there is no trained model.
        ValueError: if the model has no output of a name.
        ParityError: if the written model differs from Keras by more than `TOLERANCE`; nothing is
            left in its place.
    """
    architecture, subnetworks = weights.load(weights_folder)
    known = answers(subnetworks)
    if unknown := sorted(set(only or ()) - set(known)):
        raise ValueError(
            f"cannot export {unknown}: {weights_folder} holds {architecture.description}; "
            f"choose from {', '.join(known)}"
        )
    network = assemble(subnetworks, only)
    folder.mkdir(parents=True, exist_ok=True)
    images = proof_images(architecture.size)
    expected = {name: np.array(value) for name, value in network(images).items()}
    write, target, run = {
        "savedmodel": (write_saved_model, folder / "saved_model", run_saved_model),
        "onnx": (write_onnx, folder / "lime.onnx", run_onnx),
    }[model_format]
    partial = target.with_name(f"partial-{target.name}")
    _remove(partial)
    try:
        write(network, partial)
        differences = compare(expected, run(partial, images))
        wrong = {name: value for name, value in differences.items() if not value <= TOLERANCE}
        if wrong:
            raise ParityError(f"the {model_format} model differs from Keras: {wrong}")
        _remove(target)
        partial.rename(target)
    finally:
        _remove(partial)
    return differences


def proof_images(size: int) -> np.ndarray:
    """Images `(6, size, size, 3)` in [0, 1]: shaded balls, smooth, noisy, black and white.

    The balls, one dull and one shiny, are there because a trained mask is empty without an object,
    and everything behind an empty mask would agree for nothing.
    """
    rng = np.random.default_rng(0)
    coarse = rng.uniform(size=(1, 8, 8, 3)).astype(np.float32)
    smooth = np.array(tf.image.resize(coarse, (size, size)))
    noisy = rng.uniform(size=(1, size, size, 3)).astype(np.float32)
    balls = [_ball(size, exponent)[None] for exponent in (3.0, 300.0)]
    return np.concatenate([*balls, smooth, noisy, np.zeros_like(noisy), np.ones_like(noisy)])


def _ball(size: int, exponent: float) -> np.ndarray:
    """A lit ball with a highlight before stripes, `(size, size, 3)` in [0, 1]."""
    x, y = np.meshgrid(*[np.linspace(-1.25, 1.25, size)] * 2)
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    towards_light = np.maximum(0.4 * x - 0.5 * y + 0.77 * z, 0)[..., None]
    highlight = np.maximum(0.21 * x - 0.27 * y + 0.94 * z, 0)[..., None] ** exponent
    ball = np.array([0.5, 0.3, 0.2]) * towards_light + 0.5 * highlight
    stripes = 0.4 + 0.2 * np.sin(12 * x + 5 * y)[..., None] * np.array([1.0, 0.5, -1.0])
    return np.clip(np.where(z[..., None] > 0, ball, stripes), 0, 1).astype(np.float32)


def compare(expected: dict[str, np.ndarray], answer: dict[str, np.ndarray]) -> dict[str, float]:
    """Largest difference of each output, relative where the expected value is above 1.

    Raises:
        ParityError: if names or shapes differ.
    """
    shapes = {name: value.shape for name, value in expected.items()}
    found = {name: value.shape for name, value in answer.items()}
    if shapes != found:
        raise ParityError(f"outputs {found}, expected {shapes}")
    return {
        name: float(np.max(np.abs(answer[name] - value) / np.maximum(np.abs(value), 1)))
        for name, value in expected.items()
    }


def run_saved_model(path: Path, images: np.ndarray) -> dict[str, np.ndarray]:
    """Answers of a SavedModel's `serving_default` signature."""
    served = tf.saved_model.load(str(path)).signatures["serving_default"]
    return {name: value.numpy() for name, value in served(image=tf.constant(images)).items()}


def run_onnx(path: Path, images: np.ndarray) -> dict[str, np.ndarray]:
    """Answers of an ONNX model under ONNX Runtime."""
    import onnxruntime

    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, {"image": images}), strict=True))


def write_saved_model(network: keras.Model, path: Path) -> None:
    """Write a model as a SavedModel folder, unproved; answers by name as `served` has them."""
    module = tf.Module()
    module.network = network
    module.serve = served(network)
    tf.saved_model.save(module, str(path), signatures={"serving_default": module.serve})


def write_onnx(network: keras.Model, path: Path) -> None:
    """Write a model as ONNX, unproved; answers by name as `served` has them."""
    import tf2onnx

    serve = served(network)
    tf2onnx.convert.from_function(
        serve, input_signature=serve.input_signature, opset=_OPSET, output_path=str(path)
    )
    # The converter's copies of the graph hold one another, and 1 GB for a U-Net of 20 MB.
    gc.collect()


def served(network: keras.Model) -> tf.types.experimental.PolymorphicFunction:
    """The model as a function of its inputs `(B, …)`, in order, under their names.

    It answers a dictionary: the model's own, or, of a model that answers tensors, one under their
    operations' names.
    """
    signature = [
        tf.TensorSpec((None, *tensor.shape[1:]), tf.float32, name=tensor.name)
        for tensor in network.inputs
    ]

    @tf.function(input_signature=signature)
    def serve(*tensors: tf.Tensor) -> dict[str, tf.Tensor]:
        packed = keras.tree.pack_sequence_as(network.input, list(tensors))
        answer = network(packed, training=False)
        if not isinstance(answer, dict):
            answer = dict(zip(network.output_names, keras.tree.flatten(answer), strict=True))
        return {name: tf.identity(value, name=name) for name, value in answer.items()}

    return serve


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
