"""The export of a model in one of several formats, each with a parity check against Keras."""

import shutil
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import keras
import numpy as np

from lime_keras.data import pipeline
from lime_keras.data.corpus import Split
from lime_keras.export import formats, graphs, model_card, parity, quantisation, reference
from lime_keras.io import atomic
from lime_keras.model import folder as model_folder
from lime_keras.model import gloss_file, weights
from lime_keras.networks import assemble
from lime_keras.outputs import OUTPUTS
from lime_keras.runtime import onnx_graphs
from lime_keras.runtime.engine import Answering
from lime_keras.runtime.keras_engine import KerasEngine
from lime_keras.runtime.onnx_graphs import OnnxGraphs
from lime_keras.runtime.saved_model import CARD, SavedModel

SAVED_MODEL, ONNX, WEIGHTS, GRAPHS = "savedmodel", "onnx", "weights", "graphs"

_PICTURES = 64  # largest number of pictures of a corpus that are compared, or calibrate
_VERSION = "1"  # TensorFlow Serving expects a subfolder with a version number


@dataclass(frozen=True)
class _Model:
    """What an export writes: some outputs of these weights, in a precision."""

    folder: Path  # folder of the weights
    loaded: KerasEngine
    network: keras.Model
    precision: str
    calibration: np.ndarray  # images `(N, S, S, 3)` that calibrate int8, else none
    out: Path  # folder to write to

    @property
    def card(self) -> dict[str, Any]:
        lobe = model_folder.lobe(self.folder)
        return model_card.card(self.loaded.architecture, self.network, self.precision, lobe)


def _write_saved_model(model: _Model, path: Path) -> Answering:
    formats.write_saved_model(model.network, path)
    formats.write_card(path / CARD, model.card)
    return SavedModel(path)


def _write_onnx(model: _Model, path: Path) -> Answering:
    formats.write_onnx(model.network, path)
    if model.precision != "float32":
        inputs = ({"image": picture[None]} for picture in model.calibration)
        quantisation.narrow(path, model.precision, inputs)
    formats.finish_onnx(path, model.card)
    return onnx_graphs.open_file(path)


def _write_weights(model: _Model, path: Path) -> Answering:
    weights.save(path, model.loaded.architecture, model.loaded.parts, half=True)
    formats.write_card(path / CARD.name, model.card)
    for name in ("training.json", gloss_file.NAME):
        record = model_folder.folder(model.folder) / name
        if record.is_file():
            shutil.copyfile(record, path / name)
    return KerasEngine(path)


def _write_graphs(model: _Model, path: Path) -> Answering:
    loaded, digest, plain = model.loaded, model_folder.digest(model.folder), None
    if model.precision != "float32":
        plain = _plain_graphs(model.out, model.folder, digest)
    kind = (model.precision, plain, model.calibration)
    graphs.write(path, loaded.architecture, loaded.parts, digest, *kind)
    return onnx_graphs.open_folder(path)


@dataclass(frozen=True)
class Format:
    """A row of `FORMATS`."""

    write: Callable[[_Model, Path], Answering]  # writes, and returns what runs the result
    path: str  # below the folder to write to; `part` names some outputs, `bits` a precision
    precisions: tuple[str, ...]  # the default first; float16 weights are computed with in float32
    whole: str = ""  # if it always holds all outputs, a file of its folder


FORMATS = {
    SAVED_MODEL: Format(_write_saved_model, f"saved_model{{part}}/{_VERSION}", ("float32",)),
    ONNX: Format(_write_onnx, "lime{part}{bits}.onnx", model_folder.PRECISIONS),
    WEIGHTS: Format(_write_weights, "model", ("float16",), CARD.name),
    GRAPHS: Format(_write_graphs, "onnx{bits}", model_folder.PRECISIONS, model_folder.DESCRIPTION),
}


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
        precision: one of the format's precisions (`FORMATS`); by default the first.
        corpus: corpus of rendered pictures, which the camera model photographs
            (`lime_keras.data.camera`). If given, the first pictures of the test split are used in
            the parity check, too. The first pictures of the train split calibrate int8.

    Returns:
        Difference from Keras of each output (`parity.check`), by set of images: `extremes`
        (`parity.images`) and, with a corpus, `pictures`.

    Raises:
        FileNotFoundError: if there is no trained model, or a split is not rendered.
        ValueError: if the model has no output of a given name, the format does not have the
            precision, or a folder that would be replaced holds something else.
        ParityError: if the written model differs from Keras beyond the tolerance; nothing is left
            at the path.
    """
    # Check what is asked for.
    row = FORMATS[model_format]
    precision = row.precisions[0] if precision is None else precision
    if precision not in row.precisions:
        raise ValueError(
            f"the format {model_format} is {' or '.join(row.precisions)}, not {precision}"
        )
    if precision == "int8" and corpus is None:
        raise ValueError("int8 is calibrated on pictures: pass a corpus of `lime-render`")
    if row.whole and only is not None:
        raise ValueError(f"{model_format} are of a whole model: leave out what is to be answered")

    # Load the model and the images to compare.
    keras_engine = KerasEngine(weights_folder)
    size = keras_engine.architecture.size
    if unknown := sorted(set(only or ()) - set(keras_engine.outputs)):
        raise ValueError(
            f"cannot export {unknown}: {weights_folder} holds "
            f"{keras_engine.architecture.description}; "
            f"choose from {', '.join(keras_engine.outputs)}"
        )
    network = assemble(keras_engine.parts, only)
    images = {"extremes": parity.images(size)}
    if corpus is not None:
        images["pictures"] = corpus_pictures(corpus, "test", size)
    calibration = np.empty((0, 0, 0, 3), np.float32)
    if precision == "int8" and corpus is not None:
        calibration = corpus_pictures(corpus, "train", size)

    # Write.
    model = _Model(weights_folder, keras_engine, network, precision, calibration, folder)
    path = target(folder, model_format, precision, only)
    if row.whole:
        _refuse_others(path, row.whole)
        if model_format == GRAPHS:
            _refuse_others(folder / "model", model_folder.ARCHITECTURE)
            _refuse_other_weights(folder, weights_folder)
    if model_format == SAVED_MODEL:
        _refuse_others(path, str(CARD))
    before = model_folder.read_description(target(folder, GRAPHS))
    # Two commands may export the same run at once.
    with atomic.replacing(path, shared=model_format == GRAPHS) as partial:
        engine = row.write(model, partial)

        # Compare with Keras.
        names = tuple(network.output)
        predicted = {kind: parity.predictions(engine, batch) for kind, batch in images.items()}
        differences = {
            kind: parity.check_against(keras_engine, images[kind], names, outputs, precision)
            for kind, outputs in predicted.items()
        }
        if model_format == SAVED_MODEL and len(names) > 1:
            # Each output has a signature of its own, too.
            for name, whole in predicted["extremes"].items():
                outputs = parity.predictions(engine, images["extremes"], [name])
                alone = parity.check({name: whole}, outputs, precision)
                differences["extremes"][name] = max(differences["extremes"][name], alone[name])
        elif isinstance(engine, OnnxGraphs):
            # onnx's own evaluator computes in the precision that a file promises; ONNX Runtime
            # computes float16 in float32 on a processor, and sees no overflow. The evaluator is
            # slow, a second for a GFLOP.
            image = images["extremes"][:1]
            outputs = parity.predictions(reference.ReferenceGraphs(engine), image)
            parity.check_against(keras_engine, image, names, outputs, precision)
    if model_format == GRAPHS:
        is_other = not before or before.weights != model_folder.digest(weights_folder)
        _complete(folder, weights_folder, is_other=is_other)
    return differences


def target(
    folder: Path, model_format: str, precision: str = "float32", only: Collection[str] | None = None
) -> Path:
    """Return the path that `export` writes.

    It is an ONNX file, a SavedModel's folder inside a folder of versions, a folder of weights, or a
    folder of graphs. With graphs, every command takes `folder` as its `--weights`.

    A file of `only` some outputs is named after them, so that it replaces no other.
    """
    part = "" if only is None else "-" + "+".join(filter(set(only).__contains__, OUTPUTS))
    bits = "" if precision == "float32" else f"-{precision}"
    return folder / FORMATS[model_format].path.format(part=part, bits=bits)


def corpus_pictures(corpus: Path, split_name: str, size: int) -> np.ndarray:
    """Return the first images of a split, which the camera model photographs the same each time.

    Those for calibration come from shards that networks are trained on: the test split is only for
    reported results.

    Args:
        corpus: folder with the complete split.
        split_name: `train` to calibrate a quantised model, `test` to compare.
        size: height and width of the images; a divisor of the stored size.

    Returns:
        Images `(N, size, size, 3)` float32, sRGB in [0, 1]; N is at most 64.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if the images are of another size, there are fewer than two shards to train on,
            or a shard is empty or damaged.
    """
    split = Split(corpus, split_name)
    split.check_size(size)
    is_train = split_name == "train"
    shards = pipeline.training_shards(corpus)[0] if is_train else pipeline.verified_shards(split)
    dataset = pipeline.evaluation(
        shards, size=size, batch_size=_PICTURES, camera=True, features=("image",)
    )
    batches = pipeline.naming_damage(dataset.take(1).as_numpy_iterator(), shards)
    batch = next(batches, None)
    if batch is None:
        raise ValueError(f"{shards[0]} and what follows hold no examples: render them again")
    return batch["image"]


def _refuse_others(path: Path, mark: str) -> None:
    """Raise ValueError if a folder that would be replaced holds something else than `mark` says."""
    if path.is_dir() and any(path.iterdir()) and not (path / mark).is_file():
        raise ValueError(f"{path} holds other files, which would be lost: pass another OUT")


def _refuse_other_weights(folder: Path, weights_folder: Path) -> None:
    """Raise ValueError if graphs of a model would lie beside the weights of another."""
    home = model_folder.folder(folder)
    beside = any(home.glob(f"*{model_folder.WEIGHTS}"))
    if beside and model_folder.digest(folder) != model_folder.digest(weights_folder):
        raise ValueError(f"{home} holds other weights: pass --weights {folder}, or another OUT")


def _complete(folder: Path, weights_folder: Path, *, is_other: bool) -> None:
    """Copy what lies beside a model's weights, so that a folder of graphs is a whole model.

    Of another model than that of the graphs before, what lay beside those goes.
    """
    source, model = model_folder.folder(weights_folder), model_folder.folder(folder)
    if any(model.glob(f"*{model_folder.WEIGHTS}")) or model.resolve() == source.resolve():
        return
    model = folder / "model"
    model.mkdir(parents=True, exist_ok=True)
    for stale in model.glob("*.json") if is_other else ():
        stale.unlink()
    for path in sorted(source.glob("*.json")):
        # A calibration of one's own stays.
        if path.name != gloss_file.NAME or not (model / path.name).exists():
            shutil.copyfile(path, model / path.name)


def _plain_graphs(folder: Path, weights_folder: Path, digest: str) -> OnnxGraphs:
    """Return the engine of the graphs in float32, written before if they are not there."""
    path = target(folder, GRAPHS)
    description = model_folder.read_description(path)
    if description is None or description.weights != digest:
        export(folder, GRAPHS, weights_folder)
    return onnx_graphs.open_folder(path)
