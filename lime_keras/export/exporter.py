"""The export of a model in one of several formats, each with a parity check against Keras."""

import shutil
import tempfile
from collections.abc import Collection, Mapping
from pathlib import Path

import keras
import numpy as np

from lime_keras.arrays import Predict
from lime_keras.data import pipeline, samples
from lime_keras.data.corpus import Split
from lime_keras.export import formats, graphs, model_card, parity, quantisation
from lime_keras.export.formats import SERVED
from lime_keras.io import atomic
from lime_keras.model import folder as model_folder
from lime_keras.model import graphs as graph_folder
from lime_keras.model import weights
from lime_keras.networks import assemble, output_names
from lime_keras.outputs import OUTPUTS
from lime_keras.runtime.engine import OnnxEngine

SAVED_MODEL, ONNX, WEIGHTS, GRAPHS = "savedmodel", "onnx", "weights", "graphs"
PRECISIONS = {
    SAVED_MODEL: ("float32",),
    ONNX: ("float32", "float16", "int8"),
    WEIGHTS: ("float16",),
    GRAPHS: ("float32",),
}
"""Precisions of each format, its default first. Float16 weights are computed with in float32."""

_VERSION = "1"  # TensorFlow Serving expects a subfolder with a version number
_PICTURES = 64


def export(
    folder: Path,
    model_format: str,
    weights_folder: Path,
    only: Collection[str] | None = None,
    *,
    precision: str | None = None,
    corpus: Path | None = None,
) -> dict[str, dict[str, float]]:
    """Write a model to a file or folder and check its parity with Keras.

    Args:
        folder: folder to write to; `target` returns the path in it.
        model_format: `savedmodel`; `onnx`; `weights` (`lime_keras.model.weights.save`); or
            `graphs`, which the estimator runs (`lime_keras.runtime`).
        weights_folder: run of `lime-train`, or folder of `lime_keras.model.weights.save`.
        only: names of outputs, out of `lime_keras.networks.output_names`; by default all outputs of
            the model.
        precision: one of the format's `PRECISIONS`; by default the first.
        corpus: corpus of rendered pictures, which the camera model photographs
            (`lime_keras.data.camera`). If given, the first pictures of the test split are used in
            the parity check, too. The first pictures of the train split calibrate int8.

    Returns:
        Difference from Keras of each output (`parity.judge`), by set of images: `extremes`
        (`parity.images`) and, with a corpus, `pictures`.

    Raises:
        FileNotFoundError: if there is no trained model, or a split is not rendered.
        ValueError: if the model has no output of a given name, or the format does not have the
            precision.
        ParityError: if the written model differs from Keras beyond the tolerance; nothing is left
            at the path.
    """
    precision = PRECISIONS[model_format][0] if precision is None else precision
    _check(model_format, precision, corpus, only)
    digest = model_folder.digest(weights_folder)
    architecture, subnetworks = weights.load(weights_folder)
    known = output_names(subnetworks)
    if unknown := sorted(set(only or ()) - set(known)):
        raise ValueError(
            f"cannot export {unknown}: {weights_folder} holds {architecture.description}; "
            f"choose from {', '.join(known)}"
        )
    network = assemble(subnetworks, only)
    card = model_card.card(architecture, network, precision)
    images = _images(architecture.size, corpus)
    path = target(folder, model_format, precision, only)
    # Two estimators may export the same run at once.
    with atomic.replacing(path, shared=model_format == GRAPHS) as partial:
        if model_format == SAVED_MODEL:
            formats.write_saved_model(network, partial)
            formats.describe_saved_model(partial, card)
            signatures = formats.open_saved_model(partial)
        elif model_format == WEIGHTS:
            weights.save(partial, architecture, subnetworks, half=True)
            formats.describe_weights(partial, card)
            record = model_folder.folder(weights_folder) / "training.json"
            if record.is_file():
                shutil.copyfile(record, partial / record.name)
            signatures = {SERVED: assemble(weights.load(partial)[1])}
        elif model_format == GRAPHS:
            graphs.write(partial, architecture, subnetworks, digest)
            signatures = {SERVED: _joined(partial)}
        else:
            _write_onnx(network, partial, precision, corpus)
            formats.describe_onnx(partial, card)
            signatures = {SERVED: formats.open_onnx(partial)}
        differences = _check_parity(network, signatures, images, precision)
    return differences


def target(
    folder: Path,
    model_format: str,
    precision: str = "float32",
    only: Collection[str] | None = None,
) -> Path:
    """Return the path that `export` writes.

    It is an ONNX file, a SavedModel's folder inside a folder of versions, a folder of weights, or a
    folder of graphs. With weights, every command takes `folder` as its `--weights`; graphs are used
    where `folder` is the run that they were exported from.

    What answers `only` some outputs is named after them, so it takes no other model's place.
    """
    part = "" if only is None else "-" + "+".join(filter(set(only).__contains__, OUTPUTS))
    if model_format == SAVED_MODEL:
        return folder / f"saved_model{part}" / _VERSION
    if model_format == WEIGHTS:
        return folder / "model"
    if model_format == GRAPHS:
        return folder / "onnx"
    bits = "" if precision == "float32" else f"-{precision}"
    return folder / f"lime{part}{bits}.onnx"


def _check(
    model_format: str, precision: str, corpus: Path | None, only: Collection[str] | None
) -> None:
    if precision not in PRECISIONS[model_format]:
        raise ValueError(
            f"the format {model_format} is {' or '.join(PRECISIONS[model_format])}, not {precision}"
        )
    if precision == "int8" and corpus is None:
        raise ValueError("int8 is calibrated on pictures: pass a corpus of `lime-render`")
    if model_format in (WEIGHTS, GRAPHS) and only is not None:
        raise ValueError(f"{model_format} are of a whole model: leave out what is to be answered")


def _joined(folder: Path) -> Predict:
    """Return the answer of a folder of graphs."""
    description = graph_folder.read(folder)
    if description is None:
        raise ValueError(f"{folder} holds no graphs: export them")
    engine = OnnxEngine(folder, description)
    return lambda images: engine.run(engine.outputs, {"image": images})


def _images(size: int, corpus: Path | None) -> dict[str, np.ndarray]:
    """Return the sets of images for the parity check, by name."""
    out = {"extremes": parity.images(size)}
    if corpus is not None:
        shards = pipeline.whole_shards(Split(corpus, "test"))
        out["pictures"] = samples.first(shards, size, _PICTURES, camera=True)
    return out


def _write_onnx(network: keras.Model, path: Path, precision: str, corpus: Path | None) -> None:
    """Write an ONNX file in one of its `PRECISIONS`."""
    if precision == "float32":
        return formats.write_onnx(network, path)
    with tempfile.TemporaryDirectory() as scratch:
        whole, prepared = Path(scratch) / "whole.onnx", Path(scratch) / "prepared.onnx"
        formats.write_onnx(network, whole)
        quantisation.prepare(whole, prepared)
        if precision == "float16":
            quantisation.write_float16(prepared, path)
        elif corpus is not None:
            pictures = samples.calibration(corpus, network.input_shape[1], camera=True)
            quantisation.write_int8(prepared, path, pictures)


def _check_parity(
    network: keras.Model,
    signatures: Mapping[str, Predict],
    images: Mapping[str, np.ndarray],
    precision: str,
) -> dict[str, dict[str, float]]:
    """Check the parity of a written model.

    The signature with all outputs is checked on all images, the signatures with a single output on
    the extremes alone.
    """
    out = {}
    for name, batch in images.items():
        expected = parity.answers(network, batch)
        out[name] = parity.judge(expected, parity.answers(signatures[SERVED], batch), precision)
        if name == "extremes":
            for output in set(signatures) - {SERVED}:
                found = parity.answers(signatures[output], batch)
                alone = parity.judge({output: expected[output]}, found, precision)
                out[name][output] = max(out[name][output], alone[output])
    return out
