"""The measures of Table 1 and of the layers, with bootstrap intervals and reference values.

Every measure is a function of the means of some columns, so one bootstrap serves all measures.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lime_keras import metrics
from lime_keras.optics import microfacets, shininess

from ..markdown_table import ABSENT
from . import calibration
from .evaluate import Evaluation

_RESAMPLES = 1000
_BOOTSTRAP_SEED = 2018


@dataclass(frozen=True)
class Unit:
    """The unit in which a measure is printed.

    Attributes:
        name: symbol after the number; may be empty.
        scale: factor of the printed number.
        digits: number of digits after the decimal point.
    """

    name: str
    scale: float
    digits: int

    def number(self, value: float | None) -> str:
        """Return a value as text, such as `45.07 %`; a dash for None."""
        if value is None:
            return ABSENT
        return f"{self.scale * value:.{self.digits}f} {self.name}".rstrip()

    def with_interval(self, value: float, interval: Sequence[float]) -> str:
        """Return a value and half the width of its interval as text, such as `45.07 ± 1.20 %`."""
        half = self.scale * (interval[1] - interval[0]) / 2
        return f"{self.scale * value:.{self.digits}f} ± {half:.{self.digits}f} {self.name}".rstrip()


PLAIN, PER_CENT, DECIBEL = Unit("", 1, 4), Unit("%", 100, 2), Unit("dB", 1, 2)


@dataclass(frozen=True)
class Measure:
    """A measure of accuracy, as all tables show it.

    Attributes:
        title: name of the measure.
        short: short name, for the header of a column.
        columns: names of the columns whose means the measure needs: columns of `Evaluation.rows`;
            `exact`, `adjacent` and `within_one`, computed from `bin_distance`; `log_signed`, the
            error of log10 s with its sign; or `calibration.GAPS`, computed from
            `bin_probabilities`. A system without one of them does not have the measure.
        of_means: function from the columns' means (numbers or arrays of one shape) to the measure.
        unit: unit in which the measure is printed; shares are printed in per cent.
        more_is_better: whether a higher value is better; None if neither direction is better (the
            neighbouring bin is half right).
        paper: value of the paper's "full approach" in Table 1, if it is printed.
        floor: error that remains with perfect classification into bins (quantisation).
    """

    title: str
    short: str
    columns: tuple[str, ...]
    of_means: Callable[..., Any] = lambda mean: mean
    unit: Unit = PLAIN
    more_is_better: bool | None = False
    paper: float | None = None
    floor: float | None = None


_SHARE: dict[str, Any] = {"unit": PER_CENT, "more_is_better": True}
_PSNR: dict[str, Any] = {"unit": DECIBEL, "more_is_better": True}

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
        "Exponent, right bin", "right bin", ("exact",), paper=0.4507, **_SHARE
    ),
    "exponent_adjacent": Measure(
        "Exponent, neighbouring bin",
        "adjacent bin",
        ("adjacent",),
        unit=PER_CENT,
        more_is_better=None,
        paper=0.4012,
    ),
    "exponent_within_one": Measure(
        "Exponent, right or neighbouring", "right or next", ("within_one",), paper=0.8519, **_SHARE
    ),
    "log_exponent_mae": Measure(
        "Exponent, error of log10 s", "log10 s error", ("log_error",), paper=0.3073
    ),
    "log_exponent_rmse": Measure(
        "Exponent, RMSE of log10 s", "log10 s RMSE", ("log_squared",), np.sqrt
    ),
    "log_exponent_mae_winning": Measure(
        "Exponent, error of log10 s, winning bin",
        "log10 s error, winning",
        ("log_error_winning",),
        paper=0.3073,
        floor=shininess.QUANTISATION_FLOOR,
    ),
    "log_exponent_bias": Measure(
        "Exponent, bias of log10 s (estimated − true)",
        "log10 s bias",
        ("log_signed",),
        more_is_better=None,
    ),
    "ggx_alpha_mae": Measure("Exponent as GGX α, MAE", "GGX α MAE", ("ggx_alpha_error",)),
    "diffuse_albedo_mae": Measure(
        "Diffuse albedo, MAE", "diffuse MAE", ("diffuse_absolute",), paper=0.0674
    ),
    "diffuse_albedo_rmse": Measure(
        "Diffuse albedo, RMSE", "diffuse RMSE", ("diffuse_squared",), np.sqrt
    ),
    "specular_albedo_mae": Measure(
        "Specular albedo, MAE", "specular MAE", ("specular_absolute",), paper=0.2158
    ),
    "specular_albedo_rmse": Measure(
        "Specular albedo, RMSE", "specular RMSE", ("specular_squared",), np.sqrt
    ),
    "specular_shading_relative": Measure(
        "Specular shading S, relative error",
        "S error",
        ("specular_shading_relative", "specular_shading_lit"),
        metrics.mean_where_lit,
    ),
    "specular_shading_flip": Measure(
        "Specular shading S, ꟻLIP", "S ꟻLIP", ("specular_shading_flip",)
    ),
    "mirror_relative": Measure(
        "Mirror image M, relative error",
        "M error",
        ("mirror_relative", "mirror_lit"),
        metrics.mean_where_lit,
    ),
    "mirror_flip": Measure("Mirror image M, ꟻLIP", "M ꟻLIP", ("mirror_flip",)),
    "relighting_psnr": Measure("Relit under the photo's light, PSNR", "relit", ("relit",), **_PSNR),
    "relighting_psnr_unseen": Measure(
        "Relit under a light not seen, PSNR", "relit, unseen light", ("relit_unseen",), **_PSNR
    ),
    "calibration_error": Measure(
        "Probabilities, expected calibration error",
        "calibration error",
        calibration.GAPS,
        lambda *gaps: sum(map(np.abs, gaps)),
    ),
}


def summarise(evaluation: Evaluation) -> dict[str, Any]:
    """Return the content of `metrics.json` for one evaluation.

    Returns:
        Each of `MEASURES` that the system has, by name, shares in [0, 1]; `count` of the examples;
        `counted`, the number of examples that a measure counts, by each measure that leaves some
        out; `system`, its description; and, by measure where they exist, `interval` (95 %
        bootstrap, `[low, high]`), `true_mask`, `paper`, `chance` (the best prediction that ignores
        the image) and `floor`.
    """
    measured = values(evaluation.rows)
    summary: dict[str, Any] = dict(measured)
    summary["count"] = len(evaluation.rows["bin"])
    summary["counted"] = _counted(evaluation.rows)
    summary["system"] = evaluation.architecture.description
    summary["interval"] = ends(resampled(evaluation.rows))
    summary["true_mask"] = values(evaluation.true_mask) if evaluation.true_mask else {}
    compared: dict[str, Mapping[str, float | None]] = {
        "paper": {name: measure.paper for name, measure in MEASURES.items()},
        "chance": constant_answers(evaluation.rows),
        "floor": {name: measure.floor for name, measure in MEASURES.items()},
    }
    for kind, numbers in compared.items():
        summary[kind] = {n: numbers[n] for n in measured if numbers.get(n) is not None}
    return summary


def values(rows: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Compute, by name, the measures whose columns exist in these rows."""
    means = {name: float(np.mean(column)) for name, column in _columns(rows).items()}
    return {name: float(value) for name, value in _measured(means).items()}


def ends(drawn: Mapping[str, np.ndarray]) -> dict[str, list[float]]:
    """Return the ends `[low, high]` of the 95 % interval of drawn values, by name."""
    return {name: np.percentile(values, (2.5, 97.5)).tolist() for name, values in drawn.items()}


def resampled(rows: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Compute each measure on 1,000 bootstrap samples of the examples, `(1000,)` by name.

    Rows of the same length get the same samples. The difference of two systems is therefore a
    paired one: it is taken on the same examples.
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
    """Compute the measures of the best constant predictions for these examples, by name.

    Of layers that is black, and of relighting the material in the middle of all ranges.
    """
    shares = np.bincount(rows["bin"], minlength=shininess.BIN_COUNT) / len(rows["bin"])
    padded = np.pad(shares, 1)
    adjacent = padded[:-2] + padded[2:]
    log = rows["log_exponent"]
    alpha = microfacets.ggx_alpha(10.0**log)
    diffuse, specular = rows["diffuse_albedo"], rows["specular_albedo"]
    constant = {
        "mask_iou": np.mean(rows["coverage"]),
        "exponent_exact": np.max(shares),
        "exponent_adjacent": np.max(adjacent),
        "exponent_within_one": np.max(shares + adjacent),
        "log_exponent_mae": np.mean(np.abs(log - np.median(log))),
        "log_exponent_mae_winning": np.mean(np.abs(log - np.median(log))),
        "log_exponent_rmse": np.std(log),
        "ggx_alpha_mae": np.mean(np.abs(alpha - np.median(alpha))),
        "diffuse_albedo_mae": np.mean(np.abs(diffuse - np.median(diffuse, axis=0))),
        "diffuse_albedo_rmse": np.sqrt(np.mean(np.var(diffuse, axis=0))),
        "specular_albedo_mae": np.mean(np.abs(specular - np.median(specular))),
        "specular_albedo_rmse": np.std(specular),
        "specular_shading_relative": 1.0,
        "mirror_relative": 1.0,
        "relighting_psnr": np.mean(rows["average_relit"]),
        "relighting_psnr_unseen": np.mean(rows["average_relit_unseen"]),
    }
    return {name: float(value) for name, value in constant.items()}


def _counted(rows: Mapping[str, np.ndarray]) -> dict[str, int]:
    """Return the number of lit layers by name of the relative error, where some are black."""
    return {
        name.replace("_lit", "_relative"): int(column.sum())
        for name, column in rows.items()
        if name.endswith("_lit") and not column.all()
    }


def _measured(means: Mapping[str, Any]) -> dict[str, Any]:
    """Compute the measures whose columns exist from the means of the columns."""
    return {
        name: measure.of_means(*(means[column] for column in measure.columns))
        for name, measure in MEASURES.items()
        if means.keys() >= set(measure.columns)
    }


def _columns(rows: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the columns `(N,)` whose means the measures need, as float64."""
    columns = dict(rows)
    if "log_exponent_found" in rows:
        columns["log_signed"] = rows["log_exponent_found"] - rows["log_exponent"]
    if "bin_distance" in rows:
        distance = rows["bin_distance"]
        columns |= {"exact": distance == 0, "adjacent": distance == 1, "within_one": distance <= 1}
        if "bin_probabilities" in rows:
            columns |= calibration.gaps(rows["bin_probabilities"], distance == 0)
    needed = {column for measure in MEASURES.values() for column in measure.columns}
    columns = {name: column for name, column in columns.items() if name in needed}
    return {name: np.asarray(column, np.float64) for name, column in columns.items()}
