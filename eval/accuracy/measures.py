"""From rows to Table 1: each measure with its interval, and what to hold it against.

Every measure is a function of the means of some columns, so one bootstrap serves them all.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lime_keras import metrics
from lime_keras.optics import shininess

from ..markdown_table import ABSENT
from . import calibration, labels
from .evaluate import Evaluation
from .relighting import HIGHEST_PSNR

_RESAMPLES = 1000
_BOOTSTRAP_SEED = 2018
_UNIFORM_MAE, _UNIFORM_RMSE = 0.25, math.sqrt(1 / 12)
"""Errors of always answering 0.5 for a number drawn uniformly from [0, 1]."""
_RANGE_RMSE = (shininess.LOG_HIGH - shininess.LOG_LOW) / math.sqrt(12)
"""Of always answering the middle of the range of log10 s."""


@dataclass(frozen=True)
class Unit:
    """How a measure is printed.

    Attributes:
        name: what follows the number, if anything.
        scale: what the measure is multiplied by.
        digits: after the point.
    """

    name: str
    scale: float
    digits: int

    def number(self, value: float | None) -> str:
        """A value, such as `45.07 %`; a dash for none."""
        if value is None:
            return ABSENT
        return f"{self.scale * value:.{self.digits}f} {self.name}".rstrip()

    def with_interval(self, value: float, interval: Sequence[float]) -> str:
        """A value and half the width of its interval, such as `45.07 ± 1.20 %`."""
        half = self.scale * (interval[1] - interval[0]) / 2
        return f"{self.scale * value:.{self.digits}f} ± {half:.{self.digits}f} {self.name}".rstrip()


PLAIN, PER_CENT, DECIBEL = Unit("", 1, 4), Unit("%", 100, 2), Unit("dB", 1, 2)


@dataclass(frozen=True)
class Measure:
    """One thing that is measured, as every table has it.

    Attributes:
        title: what is measured, in words.
        short: the same for the head of a column.
        columns: of `Evaluation.rows`, or `exact`, `adjacent` and `within_one` of its
            `bin_distance`, or `calibration.GAPS` of its `bin_probabilities`; a system that lacks
            one does not have the measure.
        of_means: the measure from the columns' means (numbers or arrays of one shape).
        unit: how it is printed; a share of 1 in per cent.
        more_is_better: which way is up; None where neither is (a neighbouring bin is half right).
        perfect: what the truth itself would reach.
        paper: Table 1's "full approach", where the paper prints it.
        chance: what an answer that knows nothing reaches, or the columns' names for one, whose
            mean says it for these very examples.
        floor: what perfect classification still errs by.
    """

    title: str
    short: str
    columns: tuple[str, ...]
    of_means: Callable[..., Any] = lambda mean: mean
    unit: Unit = PLAIN
    more_is_better: bool | None = False
    perfect: float = 0.0
    paper: float | None = None
    chance: float | str | None = None
    floor: float | None = None


def _root(mean: Any) -> Any:
    return np.sqrt(mean)


def _sum_of_sizes(*gaps: Any) -> Any:
    """Σ|gap| over the bins of confidence."""
    return sum(np.abs(gap) for gap in gaps)


_SHARE: dict[str, Any] = {"unit": PER_CENT, "more_is_better": True, "perfect": 1.0}
_PSNR: dict[str, Any] = {"unit": DECIBEL, "more_is_better": True, "perfect": HIGHEST_PSNR}
_GUESSED_BIN = 1 / shininess.BIN_COUNT

MEASURES = {
    "mask_iou": Measure("Mask IoU, mean over images", "mask IoU", ("iou",), paper=0.9983, **_SHARE),
    "mask_iou_pooled": Measure(
        "Mask IoU, all pixels pooled",
        "mask IoU, pooled",
        ("intersection", "union"),
        metrics.overlap_ratio,
        **_SHARE,
    ),
    "exponent_exact": Measure(
        "Exponent, right bin", "right bin", ("exact",), paper=0.4507, chance=_GUESSED_BIN, **_SHARE
    ),
    "exponent_adjacent": Measure(
        "Exponent, neighbouring bin",
        "adjacent bin",
        ("adjacent",),
        unit=PER_CENT,
        more_is_better=None,
        paper=0.4012,
        chance=2 * _GUESSED_BIN,
    ),
    "exponent_within_one": Measure(
        "Exponent, right or neighbouring",
        "right or next",
        ("within_one",),
        paper=0.8519,
        chance=3 * _GUESSED_BIN,
        **_SHARE,
    ),
    "log_exponent_mae": Measure(
        "Exponent, error of log10 s",
        "log10 s error",
        ("log_error",),
        paper=0.3073,
        chance=shininess.CHANCE_LOG_ERROR,
    ),
    "log_exponent_rmse": Measure(
        "Exponent, RMSE of log10 s", "log10 s RMSE", ("log_squared",), _root, chance=_RANGE_RMSE
    ),
    "log_exponent_mae_winning": Measure(
        "Exponent, error of log10 s, winning bin",
        "log10 s error, winning",
        ("log_error_winning",),
        paper=0.3073,
        chance=shininess.CHANCE_LOG_ERROR,
        floor=shininess.QUANTISATION_FLOOR,
    ),
    "diffuse_albedo_mae": Measure(
        "Diffuse albedo, MAE",
        "diffuse MAE",
        ("diffuse_absolute",),
        paper=0.0674,
        chance=_UNIFORM_MAE,
    ),
    "diffuse_albedo_rmse": Measure(
        "Diffuse albedo, RMSE", "diffuse RMSE", ("diffuse_squared",), _root, chance=_UNIFORM_RMSE
    ),
    "specular_albedo_mae": Measure(
        "Specular albedo, MAE",
        "specular MAE",
        ("specular_absolute",),
        paper=0.2158,
        chance=_UNIFORM_MAE,
    ),
    "specular_albedo_rmse": Measure(
        "Specular albedo, RMSE", "specular RMSE", ("specular_squared",), _root, chance=_UNIFORM_RMSE
    ),
    "specular_shading_relative": Measure(
        "Specular shading S, relative error", "S error", ("specular_shading_relative",), chance=1.0
    ),
    "specular_shading_flip": Measure(
        "Specular shading S, ꟻLIP", "S ꟻLIP", ("specular_shading_flip",)
    ),
    "mirror_relative": Measure(
        "Mirror image M, relative error", "M error", ("mirror_relative",), chance=1.0
    ),
    "mirror_flip": Measure("Mirror image M, ꟻLIP", "M ꟻLIP", ("mirror_flip",)),
    "relighting_psnr": Measure(
        "Relit under the photo's light, PSNR", "relit", ("relit",), chance="average_relit", **_PSNR
    ),
    "relighting_psnr_unseen": Measure(
        "Relit under a light not seen, PSNR",
        "relit, unseen light",
        ("relit_unseen",),
        chance="average_relit_unseen",
        **_PSNR,
    ),
    "calibration_error": Measure(
        "Probabilities, expected calibration error",
        "calibration error",
        calibration.GAPS,
        _sum_of_sizes,
    ),
}


def summarise(evaluation: Evaluation) -> dict[str, Any]:
    """What `metrics.json` holds.

    Returns:
        Each of `MEASURES` that the system has, by name, shares in [0, 1]; `count`; `system`, in
        words; and, by measure again where they exist, `interval` (95 % bootstrap, two ends),
        `oracle`, `paper`, `chance`, `floor` and `constant` (the best answer that is the same for
        every image of this very split). Of an `oracle`, which subnetworks it is: `oracle_title`,
        in short, and `oracle_is`.
    """
    measured = values(evaluation.rows)
    summary: dict[str, Any] = dict(measured)
    summary["count"] = evaluation.count
    summary["system"] = evaluation.architecture.description
    summary["interval"] = intervals(evaluation.rows)
    summary["oracle"] = values(evaluation.oracle) if evaluation.oracle else {}
    if evaluation.oracle:
        named = evaluation.architecture, evaluation.stage_one
        summary |= {"oracle_title": labels.oracle(*named), "oracle_is": labels.oracle_is(*named)}
    for kind in ("paper", "chance", "floor"):
        known = {name: getattr(MEASURES[name], kind) for name in measured}
        summary[kind] = {
            name: float(np.mean(evaluation.rows[value])) if isinstance(value, str) else value
            for name, value in known.items()
            if value is not None
        }
    summary["constant"] = constant_answers(evaluation.rows)
    return summary


def values(rows: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Those of `MEASURES` that these rows' columns allow."""
    means = {name: float(np.mean(column)) for name, column in _columns(rows).items()}
    return {name: float(value) for name, value in _measured(means).items()}


def intervals(rows: Mapping[str, np.ndarray]) -> dict[str, list[float]]:
    """95 % percentile bootstrap over examples of each measure: `[low, high]`.

    The examples are drawn with a fixed seed, so the same rows give the same interval.
    """
    return {
        name: np.percentile(drawn, (2.5, 97.5)).tolist() for name, drawn in resampled(rows).items()
    }


def resampled(rows: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Each measure on 1,000 samples of the examples, `(1000,)`.

    The same examples are drawn for any rows of the same length, so the differences of two systems'
    are those on the same samples.
    """
    rng = np.random.default_rng(_BOOTSTRAP_SEED)
    columns = _columns(rows)
    matrix = np.stack(list(columns.values()), axis=-1)
    count = len(matrix)
    means = np.empty((_RESAMPLES, matrix.shape[1]))
    for row in range(_RESAMPLES):
        drawn = np.bincount(rng.integers(count, size=count), minlength=count)
        means[row] = drawn @ matrix / count
    return _measured(dict(zip(columns, means.T, strict=True)))


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
        "log_exponent_rmse": np.std(log),
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
    distance = rows["bin_distance"]
    columns = dict(rows) | {
        "exact": distance == 0,
        "adjacent": distance == 1,
        "within_one": distance <= 1,
    }
    if "bin_probabilities" in rows:
        columns |= calibration.gaps(rows["bin_probabilities"], distance == 0)
    needed = {column for measure in MEASURES.values() for column in measure.columns}
    columns = {name: column for name, column in columns.items() if name in needed}
    return {name: np.asarray(column, np.float64) for name, column in columns.items()}
