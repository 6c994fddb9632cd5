"""From rows to Table 1: each measure with its interval, and what to hold it against.

Every measure is a function of the means of some columns, so one bootstrap serves them all.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lime_keras import shininess

from .evaluate import Evaluation

_RESAMPLES = 1000
_BOOTSTRAP_SEED = 2018
_UNIFORM_MAE, _UNIFORM_RMSE = 0.25, math.sqrt(1 / 12)
"""Errors of always answering 0.5 for a number drawn uniformly from [0, 1]."""


@dataclass(frozen=True)
class Measure:
    """One line of the table.

    Attributes:
        title: what is measured, in words.
        columns: of `Evaluation.rows`, or `exact`, `adjacent` and `within_one` of its
            `bin_distance`; a system that lacks one does not have the measure.
        of_means: the measure from the columns' means (numbers or arrays of one shape).
        is_share: whether it is a share of 1, printed in per cent.
        more_is_better: which way is up; None where neither is (a neighbouring bin is half right).
        paper: Table 1's "full approach", where the paper prints it.
        chance: what an answer that knows nothing reaches.
        floor: what perfect classification still errs by.
    """

    title: str
    columns: tuple[str, ...]
    of_means: Callable[..., Any] = lambda mean: mean
    is_share: bool = False
    more_is_better: bool | None = False
    paper: float | None = None
    chance: float | None = None
    floor: float | None = None


def _pooled_iou(intersection: Any, union: Any) -> Any:
    """Σ intersection / Σ union; 1 where there is no object at all."""
    return np.where(union > 0, intersection / np.maximum(union, 1e-9), 1.0)


_SHARE: dict[str, Any] = {"is_share": True, "more_is_better": True}

MEASURES = {
    "mask_iou": Measure("Mask IoU, mean over images", ("iou",), paper=0.9983, **_SHARE),
    "mask_iou_pooled": Measure(
        "Mask IoU, all pixels pooled", ("intersection", "union"), _pooled_iou, **_SHARE
    ),
    "exponent_exact": Measure(
        "Exponent, right bin", ("exact",), paper=0.4507, chance=1 / 8, **_SHARE
    ),
    "exponent_adjacent": Measure(
        "Exponent, neighbouring bin",
        ("adjacent",),
        is_share=True,
        more_is_better=None,
        paper=0.4012,
        chance=2 / 8,
    ),
    "exponent_within_one": Measure(
        "Exponent, right or neighbouring", ("within_one",), paper=0.8519, chance=3 / 8, **_SHARE
    ),
    "log_exponent_mae": Measure(
        "Exponent, error of log10 s",
        ("log_error",),
        paper=0.3073,
        chance=shininess.CHANCE_LOG_ERROR,
    ),
    "log_exponent_mae_winning": Measure(
        "Exponent, error of log10 s, winning bin",
        ("log_error_winning",),
        paper=0.3073,
        chance=shininess.CHANCE_LOG_ERROR,
        floor=shininess.QUANTISATION_FLOOR,
    ),
    "diffuse_albedo_mae": Measure(
        "Diffuse albedo, MAE", ("diffuse_absolute",), paper=0.0674, chance=_UNIFORM_MAE
    ),
    "diffuse_albedo_rmse": Measure(
        "Diffuse albedo, RMSE", ("diffuse_squared",), np.sqrt, chance=_UNIFORM_RMSE
    ),
    "specular_albedo_mae": Measure(
        "Specular albedo, MAE", ("specular_absolute",), paper=0.2158, chance=_UNIFORM_MAE
    ),
    "specular_albedo_rmse": Measure(
        "Specular albedo, RMSE", ("specular_squared",), np.sqrt, chance=_UNIFORM_RMSE
    ),
    "specular_shading_relative": Measure(
        "Specular shading S, relative error", ("specular_shading_relative",), chance=1.0
    ),
    "mirror_relative": Measure("Mirror image M, relative error", ("mirror_relative",), chance=1.0),
}


def summarise(evaluation: Evaluation) -> dict[str, Any]:
    """What `metrics.json` holds.

    Returns:
        Each of `MEASURES` that the system has, by name, shares in [0, 1]; `count`; `system`, in
        words; and, by measure again where they exist, `interval` (95 % bootstrap, two ends),
        `oracle`, `paper`, `chance`, `floor` and `constant` (the best answer that is the same for
        every image of this very split).
    """
    columns = _columns(evaluation.rows)
    means = {name: float(np.mean(column)) for name, column in columns.items()}
    oracle = {name: float(np.mean(c)) for name, c in _columns(evaluation.oracle).items()}
    measured = {name: float(value) for name, value in _measured(means).items()}
    summary: dict[str, Any] = dict(measured)
    summary["count"] = evaluation.count
    summary["system"] = evaluation.architecture.description
    summary["interval"] = intervals(columns)
    summary["oracle"] = {name: float(value) for name, value in _measured(oracle).items()}
    for kind in ("paper", "chance", "floor"):
        known = {name: getattr(MEASURES[name], kind) for name in measured}
        summary[kind] = {name: value for name, value in known.items() if value is not None}
    summary["constant"] = constant_answers(evaluation.rows)
    return summary


def intervals(columns: Mapping[str, np.ndarray]) -> dict[str, list[float]]:
    """95 % percentile bootstrap over examples of each measure: `[low, high]`.

    The examples are drawn with a fixed seed, so the same rows give the same interval.
    """
    rng = np.random.default_rng(_BOOTSTRAP_SEED)
    matrix = np.stack(list(columns.values()), axis=-1)
    count = len(matrix)
    resampled = np.empty((_RESAMPLES, matrix.shape[1]))
    for row in range(_RESAMPLES):
        drawn = np.bincount(rng.integers(count, size=count), minlength=count)
        resampled[row] = drawn @ matrix / count
    means = dict(zip(columns, resampled.T, strict=True))
    return {
        name: np.percentile(values, (2.5, 97.5)).tolist()
        for name, values in _measured(means).items()
    }


def constant_answers(rows: Mapping[str, np.ndarray]) -> dict[str, float]:
    """The best answers that are the same for every example, measured on these examples."""
    shares = np.bincount(rows["bin"], minlength=shininess.BIN_COUNT) / len(rows["bin"])
    padded = np.pad(shares, 1)
    adjacent = padded[:-2] + padded[2:]
    log = rows["log_exponent"]
    diffuse, specular = rows["diffuse_albedo"], rows["specular_albedo"]
    constant = {
        "mask_iou": np.mean(rows["coverage"]),
        "exponent_exact": np.max(shares),
        "exponent_adjacent": np.max(adjacent),
        "exponent_within_one": np.max(shares + adjacent),
        "log_exponent_mae": np.mean(np.abs(log - np.median(log))),
        "diffuse_albedo_mae": np.mean(np.abs(diffuse - np.median(diffuse, axis=0))),
        "diffuse_albedo_rmse": np.sqrt(np.mean(np.var(diffuse, axis=0))),
        "specular_albedo_mae": np.mean(np.abs(specular - np.median(specular))),
        "specular_albedo_rmse": np.std(specular),
    }
    return {name: float(value) for name, value in constant.items()}


def _measured(means: Mapping[str, Any]) -> dict[str, Any]:
    """Those of `MEASURES` whose columns are there, from the columns' means."""
    return {
        name: measure.of_means(*(means[column] for column in measure.columns))
        for name, measure in MEASURES.items()
        if means.keys() >= set(measure.columns)
    }


def _columns(rows: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The `(N,)` columns whose means the measures need, as float64."""
    if not rows:
        return {}
    distance = rows["bin_distance"]
    columns = {
        "exact": distance == 0,
        "adjacent": distance == 1,
        "within_one": distance <= 1,
    }
    averaged = (
        *("iou", "intersection", "union", "log_error", "log_error_winning"),
        *("diffuse_absolute", "diffuse_squared", "specular_absolute", "specular_squared"),
        *("specular_shading_relative", "mirror_relative"),
    )
    columns |= {name: rows[name] for name in averaged if name in rows}
    return {name: np.asarray(column, np.float64) for name, column in columns.items()}
