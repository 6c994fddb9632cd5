"""Run a trained system over a corpus' test split: one row of numbers per example.

Beside the system runs its oracle: ExponentNet and AlbedoNet given the true mask, S and M, or the
baseline's MaterialNet given the true reflectance map. What the oracle gets wrong, no better layers
would mend.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from json import JSONDecodeError
from pathlib import Path
from typing import Any

import keras
import numpy as np
import tensorflow as tf
from tqdm import tqdm

from lime_keras import corpus as corpus_files
from lime_keras import metrics, pipeline, records, shininess, weights
from lime_keras.dynamic_range import compress
from lime_keras.networks import Architecture, assemble
from lime_keras.reflectance_map import reflectance_map

_LEAST_EXPONENT = 10.0**shininess.LOG_LOW
"""A smaller true exponent counts as this one, as `shininess.bin_of` has it: log10 0 is no error."""


Answer = Callable[[np.ndarray], Mapping[str, np.ndarray]]
"""From images `(B, S, S, 3)` sRGB in [0, 1] to the outputs of `lime_keras.networks.assemble`."""


@dataclass(frozen=True)
class Evaluation:
    """What was measured on N test examples.

    Attributes:
        rows: columns by name, `(N,)` each, in the split's order: the example (`seed`, `index`,
            `shape`, `light`, `log_exponent`, `bin`, `diffuse_albedo` `(N, 3)`,
            `specular_albedo`), what was found (`predicted_bin`, `diffuse_found` `(N, 3)`,
            `specular_found`), and how wrong it is (`iou` and its pixel counts `intersection`
            and `union`, `coverage`, `bin_distance`, `log_error`, `log_error_winning`,
            `diffuse_absolute`, `diffuse_squared`, `specular_absolute`,
            `specular_squared`, `specular_shading_relative`, `mirror_relative`). Of what the system
            does not answer there is no column, and under regression no `log_error_winning`.
        oracle: the exponent's and the albedos' error columns, of the oracle.
        confusion: examples `(8, 8)` by true bin (row) and `predicted_bin` (column).
        architecture: of the system.
    """

    rows: dict[str, np.ndarray]
    oracle: dict[str, np.ndarray]
    confusion: np.ndarray
    architecture: Architecture

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
        camera: show the system photos of the scenes (`lime_keras.camera`), the same every time.
        answer: computes the outputs for a batch of images; by default the Keras system. With one
            given, `oracle` of the result is empty.

    Raises:
        FileNotFoundError: if the weights or the test split are missing.
        ValueError: if the split is empty, damaged or of a size that the model cannot take, or if
            the model answers with numbers that are not finite.
    """
    architecture, subnetworks = weights.load(model_dir)
    shards = test_shards(corpus)
    count = _count(shards, architecture.size)
    respond = answer or assemble(subnetworks).predict_on_batch
    rows: list[dict[str, np.ndarray]] = []
    oracle: list[dict[str, np.ndarray]] = []
    dataset = pipeline.evaluation(
        shards, size=architecture.size, batch_size=batch_size, camera=camera
    )
    batches = pipeline.naming_damage(dataset.as_numpy_iterator(), shards)
    with tqdm(total=count, desc="evaluate", unit="image") as progress:
        for example in batches:
            rows.append(measure(example, respond(example["image"])))
            if answer is None:
                oracle.append(_material_errors(example, _from_true_layers(example, subnetworks)))
            progress.update(len(example["mask"]))
    joined = _joined(rows)
    evaluation = Evaluation(joined, _joined(oracle), _confusion(joined), architecture)
    _check_finite(evaluation, model_dir)
    return evaluation


def test_shards(corpus: Path) -> list[Path]:
    """Files of the test split.

    Raises:
        FileNotFoundError: if the split is incomplete.
        ValueError: if its manifest cannot be read.
    """
    try:
        return corpus_files.shard_paths(corpus, "test")
    except (JSONDecodeError, KeyError, TypeError) as error:
        path = corpus_files.manifest_path(corpus, "test")
        raise ValueError(f"{path} is no manifest of `lime-render`: render the split again") from (
            error
        )


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
    kept = ("seed", "index", "shape", "light", "diffuse_albedo", "specular_albedo")
    return {
        **{name: example[name] for name in kept},
        "bin": shininess.bin_of(example["shininess"]),
        "log_exponent": np.log10(np.maximum(example["shininess"], _LEAST_EXPONENT)),
        "diffuse_found": estimate["diffuse_albedo"],
        "specular_found": estimate["specular_albedo"][:, 0],
        "iou": metrics.intersection_over_union(example["mask"], estimate["mask"]),
        "intersection": np.sum(true & found, **pixels),
        "union": np.sum(true | found, **pixels),
        "coverage": np.mean(true, **pixels),
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
    errors = {"log_error": metrics.log_exponent_error(exponent, log)}
    if "log_exponent" in estimate:
        # NaN is told by the error's column.
        found = shininess.bin_of(10.0 ** np.nan_to_num(log))
        distance = np.abs(found - shininess.bin_of(exponent))
        return errors | {"predicted_bin": found, "bin_distance": distance}
    probabilities = estimate["exponent_bin_probabilities"]
    winning = shininess.log_winning(probabilities)
    return errors | {
        "predicted_bin": np.argmax(probabilities, axis=-1),
        "bin_distance": metrics.bin_distance(exponent, probabilities),
        "log_error_winning": metrics.log_exponent_error(exponent, winning),
    }


def _relative_error(
    name: str, example: Mapping[str, np.ndarray], estimate: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Relative error `(B,)` of one layer inside the true mask, summed in double precision."""
    return metrics.masked_relative_error(
        example[name].astype(np.float64), estimate[name].astype(np.float64), example["mask"]
    )


def _from_true_layers(
    example: Mapping[str, np.ndarray], subnetworks: Mapping[str, keras.Model]
) -> dict[str, np.ndarray]:
    """The material that the last subnetworks read from true layers."""
    if "material" in subnetworks:
        sphere = compress(true_reflectance_map(example))
        albedos, exponent = subnetworks["material"].predict_on_batch(sphere)
    else:
        mask = example["mask"]
        shading, mirror = (
            compress(example[name]) * mask for name in ("specular_shading", "mirror")
        )
        seen = [shading, mirror] if "mirror" in subnetworks else [shading]
        albedos = subnetworks["albedo"].predict_on_batch([example["image"] * mask, shading])
        exponent = subnetworks["exponent"].predict_on_batch(seen)
    # Clipped as the assembled system's.
    albedos = np.clip(albedos, 0, 1)
    answer = {"diffuse_albedo": albedos[:, :3], "specular_albedo": albedos[:, 3:]}
    if exponent.shape[-1] == 1:
        return answer | {"log_exponent": np.clip(exponent, shininess.LOG_LOW, shininess.LOG_HIGH)}
    return answer | {"exponent_bin_probabilities": exponent}


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
    """Columns of all batches, end to end; of no batches, no columns."""
    names = batches[0] if batches else ()
    return {name: np.concatenate([batch[name] for batch in batches]) for name in names}


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
