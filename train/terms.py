"""The loss terms, with their weights, and the measures of each subnetwork.

`LEARNING` has a row for each subnetwork, with names of loss terms (rows of `TERMS`) and of measures
(rows of `MEASURES`). The measures are those of Table 1, each a Keras metric with the name that
`lime-eval` uses. Losses and measures use the true mask, whatever the objects are cut out with
(`photos.kept.INPUT_MASK`).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import keras
from keras import ops

from lime_keras import losses
from lime_keras.metrics import MaskedRelativeError, PooledIoU, WithinBins
from lime_keras.optics import camera_law, shininess
from lime_keras.optics.dynamic_range import compress
from lime_keras.optics.masking import masked_mean
from lime_keras.optics.reflectance_map import disc, true_reflectance_map
from lime_keras.optics.shading import lobe_factor

Batch = Mapping[str, Any]
"""Features of a batch by name, as `data.pipeline` names them."""


class StageOutputs(NamedTuple):
    """The results of a stage for a batch.

    Attributes:
        raw: raw predictions of the stage's subnetworks, by name of the quantity.
        seen: values that the subnetworks read, by name of the quantity, `image`, `masked_image` or
            `dichromatic`.
        outputs: outputs by name, computed from the predictions as in an assembled system.
    """

    raw: dict[str, Any]
    seen: dict[str, Any]
    outputs: dict[str, Any]


@dataclass(frozen=True)
class Units:
    """What the numbers of a stage's data and predictions mean.

    Attributes:
        lobe: lobe of S in the data, one of `corpus.LOBES`.
        linear: whether S and M are predicted as linear radiance (`Architecture.linear`).
    """

    lobe: str = "furnace"
    linear: bool = False


@dataclass(frozen=True)
class Term:
    """A loss term.

    Attributes:
        weight: factor of the term in the total loss; the paper gives none
            (docs/explanation/decisions.md).
        quantity: name of the quantity whose prediction the term compares with the truth.
        loss: function of a batch, `StageOutputs` and the `Units` of the stage; returns the loss of
            each example, `(B,)`.
        features: names of the features that it and the measures of its quantity read, beside
            `image` and `mask`.
        losses: value of `Schedule.losses` that has the term; None if every schedule has it.
    """

    weight: float
    quantity: str
    loss: "Callable[[Batch, StageOutputs, Units], Any]"
    features: tuple[str, ...] = ()
    losses: str | None = None


@dataclass(frozen=True)
class StageMeasure:
    """A measure, which evaluates the outputs on held-out examples and is not trained on.

    Attributes:
        metric: function that builds the Keras metric from its name.
        compared: function of a batch and the outputs that returns the metric's arguments, the
            truth first.
    """

    metric: Callable[[str], keras.metrics.Metric]
    compared: Callable[[Batch, Mapping[str, Any]], tuple[Any, ...]]


@dataclass(frozen=True)
class Learning:
    """The loss terms and measures of one subnetwork, and when it joins the others.

    Attributes:
        terms: names out of `TERMS`; terms of quantities that no subnetwork of the stage predicts
            are left out, and those of the other `Term.losses` (`terms_of`).
        measures: names out of `MEASURES`.
        joined: number, from 1, of the first joined stage that trains it; None if it is only trained
            alone.
        optimizer: a key of `optimizer.OPTIMIZERS` that trains it alone, whatever the schedule says;
            None for the schedule's.
    """

    terms: tuple[str, ...]
    measures: tuple[str, ...] = ()
    joined: int | None = None
    optimizer: str | None = None


@dataclass(frozen=True)
class _Truth:
    """A function that computes a truth from a batch, and the features that it reads."""

    of: Callable[[Batch, Units], Any]
    features: tuple[str, ...]


def truth(quantity: str, batch: Batch, units: Units) -> Any:
    """Return the ground truth of a quantity, linear if it is radiance."""
    return _COMPUTED[quantity].of(batch, units) if quantity in _COMPUTED else batch[quantity]


def features_of_truth(quantity: str) -> tuple[str, ...]:
    """Return the names of the features that `truth` reads."""
    return _COMPUTED[quantity].features if quantity in _COMPUTED else (quantity,)


def terms_of(subnetworks: Iterable[str], losses: str, compositing: bool = True) -> list[str]:
    """Return the names of the loss terms that subnetworks learn by.

    Args:
        subnetworks: names of the subnetworks.
        losses: which terms are learnt by: those of this `Schedule.losses`.
        compositing: whether Eq. 5 is among them.
    """
    return [
        term
        for name in subnetworks
        for term in LEARNING[name].terms
        if TERMS[term].losses in (None, losses) and (compositing or term not in PERCEPTUAL)
    ]


def features_of(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the features that loss terms read, and the measures beside them."""
    read = (feature for name in names for feature in TERMS[name].features)
    return tuple(dict.fromkeys(("image", "mask", *read)))


def metrics_of(subnetworks: Iterable[str]) -> dict[str, keras.metrics.Metric]:
    """Build the metrics of these subnetworks' measures, by name."""
    names = [name for part in subnetworks for name in LEARNING[part].measures]
    return {name: MEASURES[name].metric(name) for name in names}


def update(
    metrics: Mapping[str, keras.metrics.Metric],
    batch: Batch,
    outputs: Mapping[str, Any],
    weights: Any,
) -> None:
    """Update metrics with a batch, its `StageOutputs.outputs`, and the examples' weights `(B,)`."""
    for name, metric in metrics.items():
        metric.update_state(*MEASURES[name].compared(batch, outputs), sample_weight=weights)


def measured(metrics: Mapping[str, keras.metrics.Metric]) -> dict[str, float]:
    """Return the results of metrics by name, over all batches since they were reset."""
    return {name: float(ops.convert_to_numpy(metric.result())) for name, metric in metrics.items()}


def _reflectance_map(batch: Batch, units: Units) -> Any:
    # The map is shaded by the furnace-normalised S.
    factor = lobe_factor(batch["shininess"], units.lobe)
    shaded = {**batch, "specular_albedo": batch["specular_albedo"] * factor}
    return ops.stop_gradient(true_reflectance_map(shaded))


_LIT = ("environment", "shininess", "diffuse_albedo", "specular_albedo", "ambient")
_COMPUTED = {"reflectance_map": _Truth(_reflectance_map, _LIT)}
"""Quantities whose truth is computed, because records do not hold it."""


Loss = Callable[[Batch, StageOutputs, Units], Any]


def _mask(loss: Callable[[Any, Any], Any]) -> Loss:
    return lambda batch, answer, units: loss(batch["mask"], answer.raw["mask"])


def _shading(name: str) -> Loss:
    return lambda batch, answer, units: losses.shading_l1(
        batch[name], answer.raw[name], batch["mask"], units.linear
    )


def _map(error: Callable[[Any], Any]) -> Loss:
    def loss(batch: Batch, answer: StageOutputs, units: Units) -> Any:
        true = compress(truth("reflectance_map", batch, units))
        shape = (ops.shape(true)[0], *true.shape[1:3], 1)
        inside = ops.broadcast_to(disc(true.shape[1])[None], shape)
        return masked_mean(error(answer.raw["reflectance_map"] - true), inside)

    return loss


def _diffuse_albedo(loss: Callable[[Any, Any], Any]) -> Loss:
    return lambda batch, answer, units: loss(batch["diffuse_albedo"], answer.raw["albedos"][:, :3])


def _specular_albedo(loss: Callable[[Any, Any], Any]) -> Loss:
    return lambda batch, answer, units: loss(
        ops.expand_dims(batch["specular_albedo"], -1), answer.raw["albedos"][:, 3:]
    )


def _exponent(loss: Callable[[Any, Any], Any]) -> Loss:
    return lambda batch, answer, units: loss(
        batch["exponent_bin"], answer.raw["exponent_bin_probabilities"]
    )


def _log_exponent(loss: Callable[[Any, Any], Any]) -> Loss:
    return lambda batch, answer, units: loss(batch["shininess"], answer.raw["log_exponent"])


def _composed(batch: Batch, answer: StageOutputs) -> tuple[Any, Any, Any, Any, Any, Any, Any]:
    """Return what both forms of Eq. 5 compare: the photo, and Eq. 4 of what is estimated."""
    # Eq. 4 knows nothing of paint, so painted pixels do not count.
    albedos, unpainted = answer.raw["albedos"], batch["mask"] * (1.0 - batch["painted"])
    return (
        batch["image"],
        unpainted,
        albedos[:, :3],
        albedos[:, 3:],
        batch["ambient"],
        batch["diffuse_shading"],
        answer.seen["specular_shading"],
    )


def _compositing_printed(batch: Batch, answer: StageOutputs, units: Units) -> Any:
    return losses.compositing_l2(*_composed(batch, answer))


def _compositing(batch: Batch, answer: StageOutputs, units: Units) -> Any:
    return losses.compositing_l1(
        *_composed(batch, answer),
        clipped=batch["clipped"],
        balance=camera_law.balance(batch["cast"], camera_law.places(batch["image"].shape[1])),
    )


_OF_MAP = features_of_truth("reflectance_map")
_EXPONENTS = ("exponent_bin", "shininess")
_DIFFUSE, _SPECULAR = ("diffuse_albedo",), ("specular_albedo",)
_PERCEIVED = ("painted", "ambient", "diffuse_shading")
TERMS = {
    # The paper's. It gives no weights.
    "mask": Term(1.0, "mask", _mask(losses.mask_l2), losses="printed"),
    "specular": Term(1.0, "specular_shading", _shading("specular_shading"), ("specular_shading",)),
    "mirror": Term(1.0, "mirror", _shading("mirror"), ("mirror",)),
    "exponent_binary": Term(
        1.0,
        "exponent_bin_probabilities",
        _exponent(losses.exponent_binary_cross_entropy),
        _EXPONENTS,
        "printed",
    ),
    "log_exponent_l1": Term(
        1.0, "log_exponent", _log_exponent(losses.log_exponent_l1), _EXPONENTS, "printed"
    ),
    "diffuse_albedo": Term(1.0, "albedos", _diffuse_albedo(losses.albedo_l2), _DIFFUSE, "printed"),
    "specular_albedo": Term(
        1.0, "albedos", _specular_albedo(losses.albedo_l2), _SPECULAR, "printed"
    ),
    "compositing_printed": Term(1.0, "albedos", _compositing_printed, _PERCEIVED, "printed"),
    "reflectance_map_l2": Term(1.0, "reflectance_map", _map(ops.square), _OF_MAP, "printed"),
    # Those in their place.
    "structure": Term(1.0, "mask", _mask(losses.mask_structure), losses="robust"),
    "exponent": Term(
        0.1,
        "exponent_bin_probabilities",
        _exponent(losses.exponent_cross_entropy),
        _EXPONENTS,
        "robust",
    ),
    "log_exponent": Term(
        0.3, "log_exponent", _log_exponent(losses.log_exponent_l2), _EXPONENTS, "robust"
    ),
    "diffuse_albedo_l1": Term(
        1.0, "albedos", _diffuse_albedo(losses.albedo_l1), _DIFFUSE, "robust"
    ),
    "specular_albedo_l1": Term(
        1.0, "albedos", _specular_albedo(losses.albedo_l1), _SPECULAR, "robust"
    ),
    "compositing": Term(1.0, "albedos", _compositing, (*_PERCEIVED, "clipped", "cast"), "robust"),
    "reflectance_map": Term(1.0, "reflectance_map", _map(ops.abs), _OF_MAP, "robust"),
}
PERCEPTUAL = ("compositing", "compositing_printed")
"""The terms of Eq. 5."""


def _log_exponents(batch: Batch, outputs: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return true and estimated log10 s, each `(B, 1)`; expected value of probabilities."""
    least = 10.0**shininess.LOG_LOW
    true = ops.log10(ops.maximum(batch["shininess"], least))
    found = shininess.log_of_outputs(outputs)
    return ops.expand_dims(true, -1), ops.expand_dims(found, -1)


def _bins(batch: Batch, outputs: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return the true bins `(B,)`, and the most probable ones or those of a regressed log10 s."""
    if "log_exponent" in outputs:
        return batch["exponent_bin"], shininess.bin_of_log(shininess.log_of_outputs(outputs))
    return batch["exponent_bin"], ops.argmax(outputs["exponent_bin_probabilities"], axis=-1)


def _layers(name: str) -> Callable[[Batch, Mapping[str, Any]], tuple[Any, Any, Any]]:
    return lambda batch, outputs: (batch[name], outputs[name], batch["mask"])


MEASURES = {
    "mask_iou_pooled": StageMeasure(
        PooledIoU, lambda batch, outputs: (batch["mask"], outputs["mask"])
    ),
    "specular_shading_relative": StageMeasure(MaskedRelativeError, _layers("specular_shading")),
    "mirror_relative": StageMeasure(MaskedRelativeError, _layers("mirror")),
    "exponent_exact": StageMeasure(lambda name: WithinBins(0, name), _bins),
    "exponent_within_one": StageMeasure(lambda name: WithinBins(1, name), _bins),
    "log_exponent_mae": StageMeasure(keras.metrics.MeanAbsoluteError, _log_exponents),
    "diffuse_albedo_mae": StageMeasure(
        keras.metrics.MeanAbsoluteError,
        lambda batch, outputs: (batch["diffuse_albedo"], outputs["diffuse_albedo"]),
    ),
    "specular_albedo_mae": StageMeasure(
        keras.metrics.MeanAbsoluteError,
        lambda batch, outputs: (
            ops.expand_dims(batch["specular_albedo"], -1),
            outputs["specular_albedo"],
        ),
    ),
}

_EXPONENT = ("exponent_exact", "exponent_within_one", "log_exponent_mae")
_ALBEDOS = ("diffuse_albedo_mae", "specular_albedo_mae")
_ALBEDO_TERMS = (
    "diffuse_albedo",
    "specular_albedo",
    "diffuse_albedo_l1",
    "specular_albedo_l1",
)
_EXPONENT_TERMS = ("exponent_binary", "exponent", "log_exponent_l1", "log_exponent")
LEARNING = {
    "segmentation": Learning(("mask", "structure"), ("mask_iou_pooled",)),
    "specular": Learning(("specular",), ("specular_shading_relative",), joined=1),
    # Under Muon its deep levels grew by a factor of five each, until a level above them died.
    "mirror": Learning(("mirror",), ("mirror_relative",), joined=1, optimizer="adam"),
    "albedo": Learning((*_ALBEDO_TERMS, *PERCEPTUAL), _ALBEDOS, joined=3),
    "exponent": Learning(_EXPONENT_TERMS, _EXPONENT, joined=2),
    "trunk": Learning(
        (*_ALBEDO_TERMS, *PERCEPTUAL, *_EXPONENT_TERMS), (*_EXPONENT, *_ALBEDOS), joined=2
    ),
    "reflectance_map": Learning(("reflectance_map_l2", "reflectance_map"), joined=1),
    "material": Learning((*_ALBEDO_TERMS, *_EXPONENT_TERMS), (*_EXPONENT, *_ALBEDOS), joined=1),
}
"""Row of each subnetwork by name, in the order in which subnetworks are trained alone."""
