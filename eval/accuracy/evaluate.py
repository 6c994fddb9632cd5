"""Run a trained system over a corpus' test split: one row of numbers per example.

Beside the system runs its oracle: ExponentNet and AlbedoNet, as they were before joined training
where the run has kept them, given the true mask, S and M, or the baseline's MaterialNet given the
true reflectance map. What the oracle gets wrong, better layers alone would not mend.
"""

import os
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from lime_keras import metrics
from lime_keras.arrays import Answer
from lime_keras.data import pipeline, records
from lime_keras.data.corpus import Split
from lime_keras.material import BlinnPhong
from lime_keras.networks import SUBNETWORKS, Architecture, assemble, weights
from lime_keras.networks.wiring import needed
from lime_keras.optics import environment, shininess
from lime_keras.optics.reflectance_map import reflectance_map

from . import flip, relighting

_LEAST_EXPONENT = 10.0**shininess.LOG_LOW
"""A smaller true exponent counts as this one, as `shininess.bin_of` has it: log10 0 is no error."""


@dataclass(frozen=True)
class Evaluation:
    """What was measured on N test examples.

    Attributes:
        rows: columns by name, `(N,)` each, in the split's order: the example (`seed`, `index`,
            `shape`, `light`, `log_exponent`, `bin`, `diffuse_albedo` `(N, 3)`, `specular_albedo`,
            `coverage`, the share `saturated` of the object's pixels that the photo clips, and
            `light_contrast`, the brightest radiance over the mean), what was found
            (`predicted_bin`, `bin_probabilities` `(N, 8)`, `log_exponent_found`, `diffuse_found`
            `(N, 3)`, `specular_found`), and how wrong it is (`iou` and its pixel counts
            `intersection` and `union`, `bin_distance`, `log_error`, `log_squared`,
            `log_error_winning`, `diffuse_absolute`, `diffuse_squared`, `specular_absolute`,
            `specular_squared`, `specular_shading_relative`, `mirror_relative`, the same two with
            `_flip`, and `relit` and `relit_unseen` in decibel, beside `average_relit` and
            `average_relit_unseen`, of the material in the middle of all ranges). Of what the
            system does not answer there is no column, and under regression neither
            `log_error_winning` nor `bin_probabilities`.
        oracle: the exponent's, the albedos' and the relighting's error columns, of the oracle;
            empty where the answers were not the stored subnetworks' own.
        confusion: examples `(8, 8)` by true bin (row) and `predicted_bin` (column).
        architecture: of the system.
        stage_one: whether the oracle's encoders are as their own stages left them, which the run
            kept; else they are the system's own.
    """

    rows: dict[str, np.ndarray]
    oracle: dict[str, np.ndarray]
    confusion: np.ndarray
    architecture: Architecture
    stage_one: bool = False

    @property
    def count(self) -> int:
        """Number of examples."""
        return len(self.rows["bin"])


def evaluate(
    model_dir: Path,
    corpus: Path,
    *,
    batch_size: int = 16,
    camera: bool = False,
    answer: Answer | None = None,
) -> Evaluation:
    """Measure a trained system on a corpus' test split, with progress on standard error.

    Args:
        model_dir: folder of `weights.save`, or a run of `lime-train`.
        corpus: folder with a complete `test` split.
        batch_size: examples computed at once; changes the speed, not the numbers.
        camera: show the system photos of the scenes (`lime_keras.data.camera`), the same every
            time.
        answer: what computes the outputs, such as an exported model; by default Keras. It is
            given full batches only, the last one filled up.

    Raises:
        FileNotFoundError: if the weights or the test split are missing.
        ValueError: if the split is empty, damaged or of a size that the model cannot take, or if
            the model answers with numbers that are not finite.
    """
    architecture, subnetworks = weights.load(model_dir)
    split = Split(corpus, "test")
    shards = split.shard_paths()
    count = _count(shards, architecture.size)
    system = answer or assemble(subnetworks).predict_on_batch
    # Joined training fits the heads to estimated layers; on true ones, those before it are better.
    alone = weights.load_alone(model_dir, subnetworks)
    oracle_of = _from_true_layers(subnetworks | alone)
    rows: list[dict[str, np.ndarray]] = []
    oracle: list[dict[str, np.ndarray]] = []
    dataset = pipeline.evaluation(
        shards, size=architecture.size, batch_size=batch_size, camera=camera
    )
    batches = pipeline.naming_damage(dataset.as_numpy_iterator(), shards)
    with (
        tqdm(total=count, desc="evaluate", unit="image") as progress,
        ThreadPoolExecutor(os.cpu_count()) as pool,
        # Threads of its own in each of the pool's threads make sums over lights 5 times as slow.
        threadpool_limits(1, user_api="blas"),
    ):
        for example in batches:
            number = len(example["mask"])
            # Batches of one size, or TensorFlow compiles the networks twice.
            full = _filled(example, batch_size)
            answers = {"found": _cut(system(full["image"]), number)}
            if answer is None:
                answers["oracle"] = _cut(oracle_of(full), number)
            relit = _relit(example, answers, split.is_literal, pool)
            rows.append(
                measure(example, answers["found"])
                | _layers_flip(example, answers["found"], pool)
                | relit["found"]
                | {f"average_{name}": column for name, column in relit["average"].items()}
            )
            if answer is None:
                oracle.append(_material_errors(example, answers["oracle"]) | relit["oracle"])
            progress.update(number)
    joined = _joined(rows)
    of_oracle = _joined(oracle) if oracle else {}
    evaluation = Evaluation(joined, of_oracle, _confusion(joined), architecture, bool(alone))
    _check_finite(evaluation, model_dir)
    return evaluation


def measure(
    example: Mapping[str, np.ndarray], estimate: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """The columns of `Evaluation.rows` for one batch.

    Args:
        example: batch as `pipeline.evaluation` yields it.
        estimate: what the assembled system answers.
    """
    true, found = example["mask"] >= 0.5, estimate["mask"] >= 0.5
    pixels: dict[str, Any] = {"axis": (1, 2, 3), "dtype": np.float64}
    return {
        **{name: example[name] for name in ("seed", "index", "diffuse_albedo", "specular_albedo")},
        # As bytes of one width, not as Python's objects.
        **{name: np.asarray(example[name], np.bytes_) for name in ("shape", "light")},
        "bin": shininess.bin_of(example["shininess"]),
        "log_exponent": np.log10(np.maximum(example["shininess"], _LEAST_EXPONENT)),
        "log_exponent_found": found_log_exponent(estimate),
        "diffuse_found": estimate["diffuse_albedo"],
        "specular_found": estimate["specular_albedo"][:, 0],
        "iou": metrics.intersection_over_union(example["mask"], estimate["mask"]),
        "intersection": np.sum(true & found, **pixels),
        "union": np.sum(true | found, **pixels),
        "coverage": np.mean(true, **pixels),
        "saturated": _saturated(example),
        "light_contrast": _contrast(example["environment"]),
        **{
            f"{name}_relative": _relative_error(name, example, estimate)
            for name in ("specular_shading", "mirror")
            if name in estimate
        },
        **_material_errors(example, estimate),
    }


def found_log_exponent(estimate: Mapping[str, np.ndarray]) -> np.ndarray:
    """log10 s `(...)` of answers `(..., 8)` or `(..., 1)`: of the classes, the expected value."""
    if "log_exponent" in estimate:
        return estimate["log_exponent"][..., 0]
    return shininess.log_expected(estimate["exponent_bin_probabilities"])


def true_reflectance_map(example: Mapping[str, np.ndarray]) -> np.ndarray:
    """What the baseline's ReflectanceMapNet is to find, `(B, S, S, 3)` linear radiance.

    Args:
        example: batch as `pipeline.evaluation` yields it.
    """
    sphere = reflectance_map(
        example["environment"],
        example["shininess"],
        example["diffuse_albedo"],
        example["specular_albedo"],
        example["ambient"],
        example["mask"].shape[1],
    )
    return keras.ops.convert_to_numpy(sphere)


def _material_errors(
    example: Mapping[str, np.ndarray], estimate: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Errors of the exponent and the two albedos, `(B,)` each, and the exponent's bin."""
    diffuse = example["diffuse_albedo"], estimate["diffuse_albedo"]
    specular = example["specular_albedo"][:, None], estimate["specular_albedo"]
    return {
        **_exponent_errors(example, estimate),
        "diffuse_absolute": metrics.albedo_absolute_error(*diffuse),
        "diffuse_squared": metrics.albedo_squared_error(*diffuse),
        "specular_absolute": metrics.albedo_absolute_error(*specular),
        "specular_squared": metrics.albedo_squared_error(*specular),
    }


def _exponent_errors(
    example: Mapping[str, np.ndarray], estimate: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """The winning bin, or the one that a number falls into, how far off it is, and log errors."""
    exponent = np.maximum(example["shininess"], _LEAST_EXPONENT)
    log = found_log_exponent(estimate)
    error = metrics.log_exponent_error(exponent, log)
    errors = {"log_error": error, "log_squared": np.square(error)}
    if "log_exponent" in estimate:
        # NaN is told by the error's column.
        found = shininess.bin_of(10.0 ** np.nan_to_num(log))
        distance = np.abs(found - shininess.bin_of(exponent))
        return errors | {"predicted_bin": found, "bin_distance": distance}
    probabilities = estimate["exponent_bin_probabilities"]
    winning = shininess.log_winning(probabilities)
    return errors | {
        "predicted_bin": np.argmax(probabilities, axis=-1),
        "bin_probabilities": probabilities,
        "bin_distance": metrics.bin_distance(exponent, probabilities),
        "log_error_winning": metrics.log_exponent_error(exponent, winning),
    }


def _saturated(example: Mapping[str, np.ndarray]) -> np.ndarray:
    """Share `(B,)` of each object's pixels of which the photo clips a channel."""
    object_pixels = example["mask"] >= 0.5
    clipped = np.any(example["clipped"] > 0, axis=-1, keepdims=True) & object_pixels
    covered = np.maximum(np.sum(object_pixels, axis=(1, 2, 3)), 1)
    return np.sum(clipped, axis=(1, 2, 3)) / covered


def _contrast(radiance: np.ndarray) -> np.ndarray:
    """Brightest over mean radiance of lights `(B, H, W, 1)`; 1 of a light that is black."""
    solid_angles = environment.solid_angles(*radiance.shape[1:3])[..., None]
    mean = np.sum(np.float64(radiance) * solid_angles, axis=(1, 2, 3)) / (4 * np.pi)
    brightest = np.max(radiance, axis=(1, 2, 3))
    return np.where(mean > 0, brightest / np.where(mean > 0, mean, 1.0), 1.0)


def _layers_flip(
    example: Mapping[str, np.ndarray],
    estimate: Mapping[str, np.ndarray],
    pool: ThreadPoolExecutor,
) -> dict[str, np.ndarray]:
    """`specular_shading_flip` and `mirror_flip`, `(B,)`, of what the system estimates."""
    return {
        f"{name}_flip": np.array(
            list(pool.map(flip.layer_flip, example[name], estimate[name], example["mask"]))
        )
        for name in ("specular_shading", "mirror")
        if name in estimate
    }


def _relit(
    example: Mapping[str, np.ndarray],
    answers: Mapping[str, Mapping[str, np.ndarray]],
    literal: bool,
    pool: ThreadPoolExecutor,
) -> dict[str, dict[str, np.ndarray]]:
    """By answer, and of `average`: the columns `relit` and `relit_unseen`, `(B,)` decibel."""

    def one(row: int) -> dict[str, dict[str, float]]:
        materials = {
            name: BlinnPhong(
                answer["diffuse_albedo"][row],
                float(answer["specular_albedo"][row, 0]),
                float(10.0 ** found_log_exponent(answer)[row]),
            )
            for name, answer in answers.items()
        }
        scene = {name: example[name][row] for name in relighting.FEATURES}
        return relighting.relight(scene, materials | {"average": relighting.AVERAGE}, literal)

    each = list(pool.map(one, range(len(example["mask"]))))
    return {
        name: {column: np.array([found[name][column] for found in each]) for column in columns}
        for name, columns in each[0].items()
    }


def _filled(example: Mapping[str, np.ndarray], size: int) -> dict[str, np.ndarray]:
    """The batch with its last example repeated until there are `size`."""
    missing = size - len(example["mask"])
    return {
        name: np.concatenate([values, np.repeat(values[-1:], missing, axis=0)])
        for name, values in example.items()
    }


def _cut(answer: Mapping[str, np.ndarray], number: int) -> dict[str, np.ndarray]:
    """The first examples of each output."""
    return {name: np.asarray(values)[:number] for name, values in answer.items()}


def _relative_error(
    name: str, example: Mapping[str, np.ndarray], estimate: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Relative error `(B,)` of one layer inside the true mask, summed in double precision."""
    return metrics.masked_relative_error(
        example[name].astype(np.float64), estimate[name].astype(np.float64), example["mask"]
    )


def _from_true_layers(
    subnetworks: Mapping[str, keras.Model],
) -> Callable[[Mapping[str, np.ndarray]], dict[str, np.ndarray]]:
    """The oracle: examples to the material that the last subnetworks read from true layers."""
    encoders = {name: part for name, part in subnetworks.items() if SUBNETWORKS[name].encoder}
    given = needed(encoders)
    network = assemble(encoders, given=given)

    def answer(example: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        true = {
            name: true_reflectance_map(example) if name == "reflectance_map" else example[name]
            for name in given
        }
        return network.predict_on_batch({"image": example["image"], **true})

    return answer


def _count(shards: list[Path], size: int) -> int:
    """Number of examples in the shards, after a look whether the model can take them."""
    dataset = tf.data.TFRecordDataset([str(path) for path in shards])
    first = next(pipeline.naming_damage(dataset.take(1).map(records.parse), shards), None)
    count = sum(1 for _ in pipeline.naming_damage(dataset, shards))
    if first is None:
        folder = shards[0].parent if shards else "the test split"
        raise ValueError(f"{folder} holds no examples: render the split again with --count above 0")
    stored = first["mask"].shape[0]
    if stored % size:
        raise ValueError(
            f"{shards[0]} holds images of {stored} pixels, which cannot be averaged to the "
            f"model's {size}: render a corpus with --size {size} or a multiple of it"
        )
    return count


def _joined(batches: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Columns of all batches, end to end."""
    return {name: np.concatenate([batch[name] for batch in batches]) for name in batches[0]}


def _confusion(rows: Mapping[str, np.ndarray]) -> np.ndarray:
    """Examples `(8, 8)` by true and estimated bin."""
    matrix = np.zeros((shininess.BIN_COUNT, shininess.BIN_COUNT), np.int64)
    np.add.at(matrix, (rows["bin"], rows["predicted_bin"]), 1)
    return matrix


def _check_finite(evaluation: Evaluation, model_dir: Path) -> None:
    """Refuse NaN and infinity, and name the example that shows them."""
    for name, column in (*evaluation.rows.items(), *evaluation.oracle.items()):
        if column.dtype.kind != "f" or np.all(np.isfinite(column)):
            continue
        row = int(np.argmin(np.isfinite(column).reshape(len(column), -1).all(axis=1)))
        raise ValueError(
            f"{name} is not finite for test example {row}: the weights in {model_dir} are "
            "broken; train again, or pass another run"
        )
