"""The loss terms, with their weights, and the measures of what subnetworks predict.

The measures are those of Table 1, each a weighted mean with the name that `lime-eval` uses. Losses
and measures use the true mask, whatever the objects are cut out with (`photos.kept.INPUT_MASK`).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import keras
from keras import ops

from lime_keras import losses
from lime_keras.metrics import masked_relative_error, overlap, overlap_ratio
from lime_keras.networks import SUBNETWORKS
from lime_keras.optics import camera_law, shininess
from lime_keras.optics.dynamic_range import compress
from lime_keras.optics.masking import masked_mean
from lime_keras.optics.reflectance_map import disc, true_reflectance_map
from lime_keras.optics.shading import lobe_factor

Batch = Mapping[str, Any]  # features of a batch by name, as `data.pipeline` names them
Error = Callable[[Any, Any], Any]  # function of a truth and a prediction: the loss, `(B,)`


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
        quantity: name of the quantity that is predicted.
        features: names of the features that losses and measures of the quantity read, beside
            `image` and `mask`.
        loss: function of a batch, `StageOutputs` and the `Units` of the stage; returns the loss of
            each example, `(B,)`, without the weight.
        family: the family of losses that has the term (`Schedule.losses`); None if both have it.
    """

    weight: float
    quantity: str
    features: tuple[str, ...]
    loss: Callable[[Batch, StageOutputs, Units], Any]
    family: str | None = None


@dataclass(frozen=True)
class StageMeasure:
    """A measure, which evaluates the outputs on the validation set and is not trained on.

    Attributes:
        quantity: name of the quantity that the outputs are computed from; the
            probabilities also stand for log10 s of models that regress it.
        of_examples: function of a batch and the outputs that returns the measure of each example
            and its weight in the mean, each `(B,)` or the same number for all.
    """

    quantity: str
    of_examples: Callable[[Batch, Mapping[str, Any]], tuple[Any, Any]]


def terms_of(subnetworks: Iterable[str], family: str, compositing: bool = True) -> list[str]:
    """Return the names of the loss terms that subnetworks learn by.

    Args:
        subnetworks: names of the subnetworks.
        family: the family of losses, `printed` or `robust` (`Schedule.losses`).
        compositing: whether Eq. 5 is among them.
    """
    return [
        name
        for part in subnetworks
        for name, term in TERMS.items()
        if _REGRESSED.get(term.quantity, term.quantity) in SUBNETWORKS[part].predicts
        and term.family in (None, family)
        and (name not in PERCEPTUAL or (compositing and part not in _WITHOUT_S))
    ]


def features_of(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the features that loss terms read, and the measures beside them."""
    read = (feature for name in names for feature in TERMS[name].features)
    return tuple(dict.fromkeys(("image", "mask", *read)))


def metrics_of(subnetworks: Iterable[str]) -> dict[str, keras.metrics.Metric]:
    """Build the metrics of these subnetworks' measures, by name."""
    return {
        name: keras.metrics.Mean(name=name)
        for part in subnetworks
        for name, row in MEASURES.items()
        if row.quantity in SUBNETWORKS[part].predicts
    }


def update(
    metrics: Mapping[str, keras.metrics.Metric],
    batch: Batch,
    outputs: Mapping[str, Any],
    weights: Any,
) -> None:
    """Update metrics with a batch, its `StageOutputs.outputs`, and the examples' weights `(B,)`."""
    for name, metric in metrics.items():
        value, weight = MEASURES[name].of_examples(batch, outputs)
        metric.update_state(value, sample_weight=weights * weight)


def truth(quantity: str, batch: Batch, units: Units) -> Any:
    """Return the ground truth of a quantity, linear if it is radiance."""
    if quantity != "reflectance_map":
        return batch[quantity]
    # The map, which records do not hold, is shaded by the furnace-normalised S.
    factor = lobe_factor(batch["shininess"], units.lobe)
    shaded = {**batch, "specular_albedo": batch["specular_albedo"] * factor}
    return ops.stop_gradient(true_reflectance_map(shaded))


def features_of_truth(quantity: str) -> tuple[str, ...]:
    """Return the names of the features that `truth` reads."""
    return _OF_MAP if quantity == "reflectance_map" else (quantity,)


def _true_log_exponent(batch: Batch) -> Any:
    """Return true log10 s `(B, 1)`; exponents below 1 count as 1, as in the classes."""
    return ops.expand_dims(shininess.log_of(batch["shininess"]), -1)


def _direct(quantity: str, error: Error, family: str, weight: float = 1.0) -> Term:
    """Return the term of a prediction that is compared as it is."""
    features, true = _TRUE[quantity]
    return Term(
        weight,
        quantity,
        features,
        lambda batch, answer, units: error(true(batch), answer.raw[quantity]),
        family,
    )


def _shading(quantity: str) -> Term:
    return Term(
        1.0,
        quantity,
        (quantity,),
        lambda batch, answer, units: losses.shading_l1(
            batch[quantity], answer.raw[quantity], batch["mask"], units.linear
        ),
    )


def _true_albedo(batch: Batch, name: str) -> Any:
    """Return m_d `(B, 3)` or m_s `(B, 1)`."""
    return batch[name] if name == "diffuse_albedo" else ops.expand_dims(batch[name], -1)


def _albedo(name: str, error: Error, family: str) -> Term:
    columns = slice(3) if name == "diffuse_albedo" else slice(3, None)

    def loss(batch: Batch, answer: StageOutputs, units: Units) -> Any:
        return error(_true_albedo(batch, name), answer.raw["albedos"][:, columns])

    return Term(1.0, "albedos", (name,), loss, family)


def _map(error: Callable[[Any], Any], family: str) -> Term:
    """Return the term of the error of maps, compressed, where the sphere is."""

    def loss(batch: Batch, answer: StageOutputs, units: Units) -> Any:
        true = compress(truth("reflectance_map", batch, units))
        inside = disc(true.shape[1])[None]
        return masked_mean(error(answer.raw["reflectance_map"] - true), inside)

    return Term(1.0, "reflectance_map", _OF_MAP, loss, family)


def _compose(batch: Batch, answer: StageOutputs) -> dict[str, Any]:
    """Return what both forms of Eq. 5 compare: the photo, and Eq. 4 of what is estimated."""
    # Eq. 4 knows nothing of paint, so painted pixels do not count.
    albedos, unpainted = answer.raw["albedos"], batch["mask"] * (1.0 - batch["painted"])
    return {
        "image_srgb": batch["image"],
        "mask": unpainted,
        "diffuse_albedo": albedos[:, :3],
        "specular_albedo": albedos[:, 3:],
        "ambient": batch["ambient"],
        "diffuse_shading": batch["diffuse_shading"],
        "specular_compressed": answer.seen["specular_shading"],
    }


def _compositing_printed(batch: Batch, answer: StageOutputs, units: Units) -> Any:
    return losses.compositing_l2(**_compose(batch, answer))


def _compositing(batch: Batch, answer: StageOutputs, units: Units) -> Any:
    balance = camera_law.balance(batch["cast"], camera_law.places(batch["image"].shape[1]))
    composed = _compose(batch, answer)
    return losses.compositing_l1(**composed, clipped=batch["clipped"], balance=balance)


_PERCEIVED = ("painted", "ambient", "diffuse_shading")
_BINS = "exponent_bin_probabilities"
_REGRESSED = {"log_exponent": _BINS}
"""What the registry of subnetworks calls a quantity that a regressing one predicts instead."""

_WITHOUT_S = ("material",)
"""Subnetworks that predict albedos and read no S, and so do not learn by Eq. 5."""

_OF_EXPONENT = ("exponent_bin", "shininess")
_TRUE: Mapping[str, tuple[tuple[str, ...], Callable[[Batch], Any]]] = {
    "mask": ((), lambda batch: batch["mask"]),
    _BINS: (_OF_EXPONENT, lambda batch: batch["exponent_bin"]),
    "log_exponent": (_OF_EXPONENT, _true_log_exponent),
}
"""Features and truth of the quantities that are compared as they are."""

_OF_MAP = ("environment", "shininess", "diffuse_albedo", "specular_albedo", "ambient")
TERMS = {
    # The paper's. It gives no weights.
    "mask": _direct("mask", losses.squared, "printed"),
    "specular": _shading("specular_shading"),
    "mirror": _shading("mirror"),
    "diffuse_albedo": _albedo("diffuse_albedo", losses.squared, "printed"),
    "specular_albedo": _albedo("specular_albedo", losses.squared, "printed"),
    "compositing_printed": Term(1.0, "albedos", _PERCEIVED, _compositing_printed, "printed"),
    "exponent_binary": _direct(_BINS, losses.exponent_binary_cross_entropy, "printed"),
    "log_exponent_l1": _direct("log_exponent", losses.absolute, "printed"),
    "reflectance_map_l2": _map(ops.square, "printed"),
    # Those in their place.
    "structure": _direct("mask", losses.mask_structure, "robust"),
    "diffuse_albedo_l1": _albedo("diffuse_albedo", losses.absolute, "robust"),
    "specular_albedo_l1": _albedo("specular_albedo", losses.absolute, "robust"),
    "compositing": Term(1.0, "albedos", (*_PERCEIVED, "clipped", "cast"), _compositing, "robust"),
    "exponent": _direct(_BINS, losses.exponent_cross_entropy, "robust", 0.1),
    "log_exponent": _direct("log_exponent", losses.squared, "robust", 0.3),
    "reflectance_map": _map(ops.abs, "robust"),
}
PERCEPTUAL = ("compositing", "compositing_printed")
"""The terms of Eq. 5."""


def _iou(batch: Batch, outputs: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return the IoU of each mask and its union: the mean is the IoU of all pixels together."""
    both, either = overlap(batch["mask"], outputs["mask"])
    return overlap_ratio(both, either), ops.maximum(either, 1e-9)


def _relative(name: str) -> StageMeasure:
    return StageMeasure(
        name,
        lambda batch, outputs: masked_relative_error(batch[name], outputs[name], batch["mask"]),
    )


def _albedo_error(name: str) -> StageMeasure:
    return StageMeasure(
        "albedos",
        lambda batch, outputs: (losses.absolute(_true_albedo(batch, name), outputs[name]), 1.0),
    )


def _within(distance: int) -> StageMeasure:
    """Return the share of exponents within so many bins of the true one; NaN is within none."""

    def of_examples(batch: Batch, outputs: Mapping[str, Any]) -> tuple[Any, float]:
        if "log_exponent" in outputs:
            predicted = shininess.bin_of_log(shininess.log_of_outputs(outputs))
        else:
            predicted = ops.argmax(outputs[_BINS], axis=-1)
        error = ops.abs(ops.cast(batch["exponent_bin"], "float32") - ops.cast(predicted, "float32"))
        return error <= distance, 1.0

    return StageMeasure(_BINS, of_examples)


def _log_exponent_error(batch: Batch, outputs: Mapping[str, Any]) -> tuple[Any, float]:
    """Return the absolute error of log10 s, or of the expected value of probabilities."""
    predicted = ops.expand_dims(shininess.log_of_outputs(outputs), -1)
    return losses.absolute(_true_log_exponent(batch), predicted), 1.0


MEASURES = {
    "mask_iou_pooled": StageMeasure("mask", _iou),
    "specular_shading_relative": _relative("specular_shading"),
    "mirror_relative": _relative("mirror"),
    "exponent_exact": _within(0),
    "exponent_within_one": _within(1),
    "log_exponent_mae": StageMeasure(_BINS, _log_exponent_error),
    "diffuse_albedo_mae": _albedo_error("diffuse_albedo"),
    "specular_albedo_mae": _albedo_error("specular_albedo"),
}
