"""Table 1's measures of what a stage answers, each a Keras metric named as `lime-eval` names it.

The true mask cuts out the object, as it does throughout a stage, and answers are clipped and
expanded as the assembled system's.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import keras
from keras import ops

from lime_keras.optics import shininess
from lime_keras.optics.dynamic_range import expand
from lime_keras.streaming_metrics import MaskedRelativeError, PooledIoU, WithinBins

_MADE: dict[str, Callable[[str], keras.metrics.Metric]] = {
    "mask_iou_pooled": PooledIoU,
    "specular_shading_relative": MaskedRelativeError,
    "mirror_relative": MaskedRelativeError,
    "exponent_exact": lambda name: WithinBins(0, name),
    "exponent_within_one": lambda name: WithinBins(1, name),
    "log_exponent_mae": keras.metrics.MeanAbsoluteError,
    "diffuse_albedo_mae": keras.metrics.MeanAbsoluteError,
    "specular_albedo_mae": keras.metrics.MeanAbsoluteError,
}
_EXPONENT = ("exponent_exact", "exponent_within_one", "log_exponent_mae")
_ALBEDOS = ("diffuse_albedo_mae", "specular_albedo_mae")
_OF_SUBNETWORK = {
    "segmentation": ("mask_iou_pooled",),
    "specular": ("specular_shading_relative",),
    "mirror": ("mirror_relative",),
    "exponent": _EXPONENT,
    "albedo": _ALBEDOS,
    "reflectance_map": (),
    "material": (*_EXPONENT, *_ALBEDOS),
}


def of(subnetworks: Iterable[str]) -> dict[str, keras.metrics.Metric]:
    """The metrics, by name, that these subnetworks' answers are judged by."""
    return {name: _MADE[name](name) for part in subnetworks for name in _OF_SUBNETWORK[part]}


def update(
    metrics: Mapping[str, keras.metrics.Metric],
    batch: Mapping[str, Any],
    answer: Mapping[str, Any],
    weights: Any,
) -> None:
    """Take in a batch and what a `StageModel` answers; weights of the examples, `(B,)`."""
    for name, metric in metrics.items():
        metric.update_state(*_compared(name, batch, answer), sample_weight=weights)


def _compared(name: str, batch: Mapping[str, Any], answer: Mapping[str, Any]) -> tuple[Any, ...]:
    """Truth and answer, as the metric of that name takes them."""
    mask = batch["mask"]
    if name == "mask_iou_pooled":
        return mask, answer["mask"]
    if name == "specular_shading_relative":
        return batch["specular_shading"], expand(answer["specular"] * mask), mask
    if name == "mirror_relative":
        return batch["mirror"], expand(answer["mirror"] * mask), mask
    if name == "log_exponent_mae":
        least = 10.0**shininess.LOG_LOW
        true, found = ops.log10(ops.maximum(batch["shininess"], least)), _log(answer["exponent"])
        return ops.expand_dims(true, -1), ops.expand_dims(found, -1)
    if name in _EXPONENT:
        return batch["exponent_bin"], _bin(answer["exponent"])
    albedos = ops.clip(answer["albedos"], 0.0, 1.0)
    if name == "diffuse_albedo_mae":
        return batch["diffuse_albedo"], albedos[:, :3]
    return ops.expand_dims(batch["specular_albedo"], -1), albedos[:, 3:]


def _log(exponent: Any) -> Any:
    """log10 s `(B,)` of probabilities `(B, 8)`, the expected value, or of a regression `(B, 1)`."""
    if exponent.shape[-1] == 1:
        return ops.clip(exponent[:, 0], shininess.LOG_LOW, shininess.LOG_HIGH)
    return shininess.log_expected(exponent)


def _bin(exponent: Any) -> Any:
    """The winning class `(B,)` of probabilities `(B, 8)`, or the one a regression falls into."""
    if exponent.shape[-1] == 1:
        return shininess.bin_of_log(_log(exponent))
    return ops.argmax(exponent, axis=-1)
