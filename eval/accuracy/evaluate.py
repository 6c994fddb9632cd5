"""The evaluation of a system on a corpus' test split: one row of numbers per example.

The same networks are evaluated with the true mask, too: the difference is what the errors of
SegmentationNet cost.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tensorflow as tf
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from lime_keras import console, metrics, processors
from lime_keras.data import pipeline, records
from lime_keras.data.corpus import Split
from lime_keras.model import folder as model_folder
from lime_keras.model import weights
from lime_keras.networks import Architecture
from lime_keras.optics import environment, microfacets, shininess
from lime_keras.optics.blinn_phong import BlinnPhong
from lime_keras.runtime.engine import Arrays, Engine
from lime_keras.runtime.keras_engine import KerasEngine

from . import flip_error, relighting
from .predictions import Answers, Predictions

_AT_ONCE = 16  # number of examples computed at once


@dataclass(frozen=True)
class Evaluation:
    """The measurements of a system on N test examples.

    Attributes:
        rows: columns by name, `(N,)` each unless stated, in the order of the split.
            Ground truth: `seed`, `index`, `shape`, `light`, `log_exponent`, `bin`,
            `diffuse_albedo` `(N, 3)`, `specular_albedo`, `coverage`, `saturated` (share of the
            object's pixels that the photo clips) and `light_contrast` (brightest over mean
            radiance).
            Predictions: `predicted_bin`, `bin_probabilities` `(N, 8)`, `log_exponent_found`,
            `diffuse_found` `(N, 3)` and `specular_found`.
            Errors: `iou` and its pixel counts `intersection` and `union`, `bin_distance`,
            `log_error`, `log_squared`, `log_error_winning`, `ggx_alpha_error`, `diffuse_absolute`,
            `diffuse_squared`, `specular_absolute`, `specular_squared`, `specular_shading_relative`,
            `mirror_relative` (with `specular_shading_lit` and `mirror_lit`, 1 where the layer is
            lit inside the mask; where it is black both are 0), `specular_shading_flip`,
            `mirror_flip`, and the relighting PSNR in decibel, `relit` and `relit_unseen`.
            `average_relit` and `average_relit_unseen` are the same for the material in the middle
            of all ranges.
            A quantity that the system does not predict has no column. A system that predicts the
            exponent by regression has no `log_error_winning` and no `bin_probabilities`. Relighting
            needs a complete material.
        true_mask: error columns of the same networks with the true mask: exponent, albedos, S, M
            and relighting.
        architecture: architecture of the system.
    """

    rows: dict[str, np.ndarray]
    true_mask: dict[str, np.ndarray]
    architecture: Architecture


def evaluate(
    model_dir: Path, corpus: Path, *, camera: bool = False, engine: Engine | None = None
) -> Evaluation:
    """Measure a trained system on a corpus' test split, with progress on standard error.

    Args:
        model_dir: folder of `weights.save`, or a run of `lime-train`.
        corpus: folder with a complete `test` split.
        camera: show the system photos of the scenes (`lime_keras.data.camera`), the same every
            time.
        engine: engine of the system, which takes masks; by default its Keras model.

    Raises:
        FileNotFoundError: if the weights or the test split are missing.
        ValueError: if the split is empty, damaged, of another lobe than the model's, or of a size
            that it cannot take, or if an output of the model is not finite.
    """
    # The model and its images.
    architecture = weights.read_architecture(model_dir)
    engine = engine or KerasEngine(model_dir)
    split = Split(corpus, "test")
    check_lobe(model_dir, split)
    split.check_size(architecture.size)

    # Rows, batch by batch, and the same without SegmentationNet.
    others = [name for name in engine.outputs if name != "mask"]
    rows: list[dict[str, np.ndarray]] = []
    true_mask: list[dict[str, np.ndarray]] = []
    for first, example, pool in _batches(split, architecture.size, camera=camera):
        given = {name: example[name] for name in ("image", "mask")}
        own = engine.run(engine.outputs, {"image": given["image"]})
        known = engine.run(others, given)
        measured = measure(example, own) | _layers_flip(example, own, pool)
        with_mask = _errors(example, known)
        # Values that are not finite cannot be rendered; the PSNR of what can be is finite.
        for columns in (measured, with_mask):
            _check_finite(columns, model_dir, first)
        relit, relit_with_mask, average = _relit(example, [own, known], split.lobe, pool)
        rows.append(measured | relit | average)
        true_mask.append(with_mask | relit_with_mask)
    return Evaluation(_joined(rows), _joined(true_mask), architecture)


def check_lobe(run: Path, split: Split) -> None:
    """Raise ValueError if a model's m_s and S have another unit than those of a split."""
    learnt = model_folder.lobe(run)
    if learnt != split.lobe:
        raise ValueError(
            f"{run} learnt from a corpus of --lobe {learnt}, and {split.folder} has --lobe "
            f"{split.lobe}: their m_s and S have different units; render a test split with --lobe "
            f"{learnt}"
        )


def evaluate_predictions(predictions: Predictions, corpus: Path) -> dict[str, np.ndarray]:
    """Measure the answers of another system on a corpus' test split, as `evaluate` does a model's.

    The images have their stored size. An image counts also where the system does not answer it, or
    one of its quantities: its mask as empty, its layers as black, its numbers as the medians of the
    true ones, and its probabilities as the shares of the bins in this split.

    Returns:
        Columns as in `Evaluation.rows`, and `answered` `(N,)`: whether there is any answer.

    Raises:
        FileNotFoundError: if the test split is missing.
        ValueError: if the split is empty or damaged, or if an answer cannot be read, is out of
            range, or belongs to no image.
    """
    split = Split(corpus, "test")
    answers = Answers(predictions, split.count, split.size, _constant_answer(split))
    rows: list[dict[str, np.ndarray]] = []
    for first, example, pool in _batches(split, split.size):
        predicted = answers.batch(first, len(example["mask"]))
        columns = measure(example, predicted) | _layers_flip(example, predicted, pool)
        if {"diffuse_found", "specular_found", "log_exponent_found"} <= columns.keys():
            relit, average = _relit(example, [predicted], split.lobe, pool)
            columns |= relit | average
        rows.append(columns)
    return _joined(rows) | {"answered": answers.answered}


def measure(example: Arrays, estimate: Arrays) -> dict[str, np.ndarray]:
    """Return the columns of `Evaluation.rows` for one batch, without ꟻLIP and relighting.

    The example is as `pipeline.evaluation` yields it, the estimate as the assembled system does.
    """
    return {
        **{name: example[name] for name in ("seed", "index", "diffuse_albedo", "specular_albedo")},
        # Names become bytes of one width, which NumPy stores without Python objects.
        **{name: np.asarray(example[name], np.bytes_) for name in ("shape", "light")},
        "bin": shininess.bin_of(example["shininess"]),
        "log_exponent": shininess.log_of(example["shininess"]),
        **_predictions(estimate),
        **_mask_errors(example, estimate),
        "coverage": np.mean(example["mask"] >= 0.5, axis=(1, 2, 3), dtype=np.float64),
        "saturated": _saturated(example),
        "light_contrast": _contrast(example["environment"]),
        **_errors(example, estimate),
    }


def confusion(rows: Arrays) -> np.ndarray:
    """Return the number of examples `(8, 8)` by true bin (row) and predicted bin (column).

    The rows are those of `Evaluation`, which need `bin` and `predicted_bin` alone.
    """
    matrix = np.zeros((shininess.BIN_COUNT, shininess.BIN_COUNT), np.int64)
    np.add.at(matrix, (rows["bin"], rows["predicted_bin"]), 1)
    return matrix


def _predictions(estimate: Arrays) -> dict[str, np.ndarray]:
    """Return the columns of the estimated numbers."""
    columns = {}
    if _has_exponent(estimate):
        columns["log_exponent_found"] = shininess.log_of_outputs(estimate)
    if "diffuse_albedo" in estimate:
        columns["diffuse_found"] = estimate["diffuse_albedo"]
    if "specular_albedo" in estimate:
        columns["specular_found"] = estimate["specular_albedo"][:, 0]
    return columns


def _mask_errors(example: Arrays, estimate: Arrays) -> dict[str, np.ndarray]:
    """Return `iou` with its pixel counts, `(B,)` each; nothing without an estimated mask."""
    if "mask" not in estimate:
        return {}
    intersection, union = metrics.overlap(example["mask"], estimate["mask"])
    iou = metrics.overlap_ratio(intersection, union)
    return {"iou": iou, "intersection": intersection, "union": union}


def _errors(example: Arrays, estimate: Arrays) -> dict[str, np.ndarray]:
    """Return `predicted_bin` and the errors of all estimates but the mask."""
    errors = {}
    for name in filter(estimate.__contains__, ("specular_shading", "mirror")):
        true, predicted = (layers[name].astype(np.float64) for layers in (example, estimate))
        errors[f"{name}_relative"], errors[f"{name}_lit"] = metrics.masked_relative_error(
            true, predicted, example["mask"]
        )
    if _has_exponent(estimate):
        errors |= _exponent_errors(example, estimate)
    for name in ("diffuse", "specular"):
        if f"{name}_albedo" in estimate:
            predicted = estimate[f"{name}_albedo"]
            error = predicted - np.reshape(example[f"{name}_albedo"], predicted.shape)
            errors[f"{name}_absolute"] = np.mean(np.abs(error), axis=-1)
            errors[f"{name}_squared"] = np.mean(np.square(error), axis=-1)
    return errors


def _has_exponent(estimate: Arrays) -> bool:
    return bool({"log_exponent", "exponent_bin_probabilities"} & estimate.keys())


def _exponent_errors(example: Arrays, estimate: Arrays) -> dict[str, np.ndarray]:
    """Return the predicted bin, its distance from the true bin, and the errors of log10 s.

    The predicted bin is the winning class, or without classes the bin that contains s.
    """
    true_log = shininess.log_of(example["shininess"])
    true_bin = shininess.bin_of(example["shininess"])
    log = shininess.log_of_outputs(estimate)
    error = np.abs(true_log - log)
    alpha, true_alpha = microfacets.ggx_alpha(10.0**log), microfacets.ggx_alpha(10.0**true_log)
    errors = {
        "log_error": error,
        "log_squared": np.square(error),
        "ggx_alpha_error": np.abs(true_alpha - alpha),
    }
    if "exponent_bin_probabilities" not in estimate:
        # A NaN prediction stays NaN in `log_error`, which `_check_finite` refuses.
        predicted = shininess.bin_of(10.0 ** np.nan_to_num(log))
        return errors | {"predicted_bin": predicted, "bin_distance": np.abs(predicted - true_bin)}
    probabilities = estimate["exponent_bin_probabilities"]
    winning = np.argmax(probabilities, axis=-1)
    return errors | {
        "predicted_bin": winning,
        "bin_probabilities": probabilities,
        "bin_distance": np.abs(winning - true_bin),
        "log_error_winning": np.abs(true_log - shininess.LOG_MEANS[winning]),
    }


def _saturated(example: Arrays) -> np.ndarray:
    """Return the share `(B,)` of each object's pixels that are clipped in any channel."""
    object_pixels = example["mask"] >= 0.5
    clipped = np.any(example["clipped"] > 0, axis=-1, keepdims=True) & object_pixels
    covered = np.maximum(np.sum(object_pixels, axis=(1, 2, 3)), 1)
    return np.sum(clipped, axis=(1, 2, 3)) / covered


def _contrast(radiance: np.ndarray) -> np.ndarray:
    """Return the brightest over the mean radiance `(B,)` of lights `(B, H, W, 1)`; 1 if black."""
    solid_angles = environment.solid_angles(*radiance.shape[1:3])[..., None]
    mean = np.sum(np.float64(radiance) * solid_angles, axis=(1, 2, 3)) / (4 * np.pi)
    brightest = np.max(radiance, axis=(1, 2, 3))
    return np.where(mean > 0, brightest / np.where(mean > 0, mean, 1.0), 1.0)


def _layers_flip(example: Arrays, estimate: Arrays, pool: Executor) -> dict[str, np.ndarray]:
    """Return `specular_shading_flip` and `mirror_flip`, `(B,)`, of the layers in `estimate`."""
    return {
        f"{name}_flip": np.array(
            list(pool.map(flip_error.layer_flip, example[name], estimate[name], example["mask"]))
        )
        for name in ("specular_shading", "mirror")
        if name in estimate
    }


def _relit(
    example: Arrays, answers: Sequence[Arrays], lobe: str, pool: Executor
) -> list[dict[str, np.ndarray]]:
    """Return `relit` and `relit_unseen`, `(B,)` decibel, of each answer.

    The last are `average_relit` and `average_relit_unseen`.
    """

    def one(row: int) -> list[list[float]]:
        materials = [
            BlinnPhong(
                answer["diffuse_albedo"][row],
                float(answer["specular_albedo"][row, 0]),
                float(10.0 ** shininess.log_of_outputs(answer)[row]),
            )
            for answer in answers
        ]
        scene = {name: example[name][row] for name in relighting.FEATURES}
        return relighting.relight(scene, [*materials, relighting.AVERAGE], lobe)

    each = np.array(list(pool.map(one, range(len(example["mask"])))))
    *found, average = (
        {"relit": relit, "relit_unseen": unseen} for relit, unseen in np.moveaxis(each, 0, -1)
    )
    return [*found, {f"average_{name}": column for name, column in average.items()}]


def _shards(split: Split) -> list[Path]:
    """Return the paths of a split's shards, whose bytes are checked; there must be an example."""
    if not split.count:
        raise ValueError(
            f"{split.folder} holds no examples: render the split again with --count above 0"
        )
    return pipeline.verified_shards(split)


def _batches(
    split: Split, size: int, *, camera: bool = False
) -> Iterator[tuple[int, dict[str, np.ndarray], ThreadPoolExecutor]]:
    """Yield batches with the position of their first example and a pool, with progress."""
    shards = _shards(split)
    dataset = pipeline.evaluation(shards, size=size, batch_size=_AT_ONCE, camera=camera)
    with (
        ThreadPoolExecutor(processors.count()) as pool,
        tqdm(total=split.count, desc="evaluate", unit="image", **console.bar_options()) as progress,
        # BLAS threads inside each thread of a pool make the sums over lights 5 times as slow.
        threadpool_limits(1, user_api="blas"),
    ):
        for example in pipeline.naming_damage(dataset.as_numpy_iterator(), shards):
            yield int(progress.n), example, pool
            progress.update(len(example["mask"]))


def _constant_answer(split: Split) -> dict[str, np.ndarray]:
    """Return the answer that ignores the image: no object, and medians of this split's numbers.

    Its outputs are named and shaped as a system's, without the batch axis.
    """
    shards = _shards(split)
    names = ("diffuse_albedo", "specular_albedo", "shininess")
    dataset = tf.data.TFRecordDataset([str(path) for path in shards])
    dataset = dataset.map(lambda serialized: records.parse(serialized, names)).batch(_AT_ONCE)
    truth = _joined(list(pipeline.naming_damage(dataset.as_numpy_iterator(), shards)))
    log = shininess.log_of(truth["shininess"])
    bins = np.bincount(shininess.bin_of(truth["shininess"]), minlength=shininess.BIN_COUNT)
    nothing = np.zeros((split.size, split.size, 1), np.float32)
    return {
        "mask": nothing,
        "specular_shading": nothing,
        "mirror": nothing,
        "diffuse_albedo": np.median(truth["diffuse_albedo"], axis=0),
        "specular_albedo": np.median(truth["specular_albedo"], keepdims=True),
        "exponent_bin_probabilities": np.float32(bins / bins.sum()),
        "log_exponent": np.median(log, keepdims=True),
    }


def _joined(batches: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Concatenate the columns of all batches."""
    return {name: np.concatenate([batch[name] for batch in batches]) for name in batches[0]}


def _check_finite(columns: Arrays, model_dir: Path, first: int) -> None:
    """Raise ValueError, naming the example, if a column of those from `first` on is not finite."""
    for name, column in columns.items():
        if column.dtype.kind != "f" or np.all(np.isfinite(column)):
            continue
        row = first + int(np.argmin(np.isfinite(column).reshape(len(column), -1).all(axis=1)))
        raise ValueError(
            f"{name} is not finite for test example {row}: the weights in {model_dir} are "
            "broken; train again, or pass another run"
        )
