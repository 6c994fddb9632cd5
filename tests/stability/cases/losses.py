"""Cases for the masked mean and the losses on masks, shading and albedos.

The references are the definitions of the losses in double precision, with derivatives worked out by
hand.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from lime_keras import losses
from lime_keras.eval.stability.verdicts import Case, Outcome
from lime_keras.optics import masking

from ..images import PIXELS, Slopes, fields, judged, masks, pairs, repeated, signs
from ..precisions import NUMPY_SINGLE, TENSORS, Precision

_PREDICTED = (-1e4, 0.0, 1.0, 11.0, 1e4)
_SHADINGS = (0.0, 1e-30, 1.0, 65504.0, 1e30)


def cases() -> list[Case]:
    """Return the cases of the masked mean and of the losses."""
    masked: dict[str, Callable[[np.ndarray, Precision], Outcome]] = {
        "masked mean": _masked_mean,
        "loss on masks": functools.partial(_of_mask, _mask_loss, _mask_l2_reference),
        "structure loss on masks": functools.partial(
            _of_mask, _structure_loss, _mask_structure_reference
        ),
        "loss on shading": _shading_l1,
    }
    out = []
    for part, function in masked.items():
        for name, mask in masks().items():
            for precision in TENSORS:
                measure = functools.partial(function, mask, precision)
                out.append(Case(part, f"{name} mask", precision.name, measure))
    for precision in (*TENSORS, NUMPY_SINGLE):
        measure = functools.partial(_large_mask, precision)
        out.append(Case("masked mean", "full mask of 256 × 256", precision.name, measure))
    for precision in TENSORS:
        for part, loss, reference in (
            ("loss", _albedo_loss, _albedo_reference),
            ("absolute loss", _absolute_albedo_loss, _albedo_l1_reference),
        ):
            measure = functools.partial(judged, loss, reference, precision, *_albedos())
            name = "albedos from -30 to 10000"
            out.append(Case(f"{part} on albedos", name, precision.name, measure))
    return out


# The functions under test; the arguments with derivatives come first. They look the library's
# functions up at run time, so that a test can replace these by broken ones.


def _mean(values: Any, mask: Any) -> Any:
    return masking.masked_mean(values, mask)


def _mask_loss(predicted: Any, mask: Any) -> Any:
    return losses.squared(mask, predicted)


def _structure_loss(predicted: Any, mask: Any) -> Any:
    return losses.mask_structure(mask, predicted)


def _shading_loss(predicted: Any, mask: Any, shading: Any) -> Any:
    return losses.shading_l1(shading, predicted, mask)


def _albedo_loss(predicted: Any, albedo: Any) -> Any:
    return losses.squared(albedo, predicted)


def _absolute_albedo_loss(predicted: Any, albedo: Any) -> Any:
    return losses.absolute(albedo, predicted)


# The masked mean.


def _masked_mean(mask: np.ndarray, precision: Precision) -> Outcome:
    """Try the masked mean of values that are NaN outside the mask."""
    levels = [x for x in (0.0, 1.0, -1e4, 65504.0, 1e30) if precision.holds(x)]
    values = np.where(mask > 0, fields(levels), np.nan)
    return judged(_mean, _masked_mean_reference, precision, values, repeated(mask, len(levels)))


def _masked_mean_reference(
    precision: Precision, values: np.ndarray, masks: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    count = len(values)
    value, size = np.zeros(count), np.zeros(count)
    by_value, by_mask, mask_size = (np.zeros_like(values) for _ in range(3))
    for b in range(count):
        chosen = masks[b] > 0
        if not chosen.any():
            continue
        weights, inside = masks[b][chosen], values[b][chosen]
        value[b] = np.average(inside, weights=weights)
        size[b] = np.average(np.abs(inside), weights=weights)
        by_value[b][chosen] = weights / weights.sum()
        by_mask[b] = -value[b] / weights.sum()
        by_mask[b][chosen] += inside / weights.sum()
        mask_size[b] = (np.abs(np.where(chosen, values[b], 0)) + size[b]) / weights.sum()
    return value, size, [(by_value, by_value, by_value), (by_mask, by_mask, mask_size)]


def _large_mask(precision: Precision) -> Outcome:
    """Try the masked mean over more pixels than the largest number of float16."""
    shape = (1, 256, 256, 1)
    found, gradients = precision.evaluate(_mean, np.full(shape, 3.0), np.ones(shape))
    value = precision.compare(found, 3.0, 3.0, 3.0, terms=256 * 256)
    if not gradients:
        return Outcome(value)
    slope = 1 / (256 * 256)
    return Outcome(value, precision.compare(gradients[0], slope, slope, slope))


# Losses under a mask.


def _of_mask(loss: Any, reference: Any, mask: np.ndarray, precision: Precision) -> Outcome:
    given = repeated(mask, len(_PREDICTED))
    return judged(loss, reference, precision, fields(_PREDICTED), given)


def _mask_l2_reference(
    precision: Precision, predicted: np.ndarray, mask: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    difference = predicted - mask
    slope = 2 * difference / PIXELS
    size = (np.abs(predicted) + np.abs(mask)) * np.abs(difference)
    value = np.array([np.square(d).sum() / PIXELS for d in difference])
    slope_size = 2 * (np.abs(predicted) + np.abs(mask)) / PIXELS
    return value, 2 * size.mean((1, 2, 3)), [(slope, slope, slope_size)]


def _mask_structure_reference(
    precision: Precision, predicted: np.ndarray, mask: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    """Return the loss and its derivative, with the window's mean summed pixel by pixel.

    The window is larger than the image, so its mean is that of the whole mask.
    """
    axes = (1, 2, 3)
    logit = 4 * (predicted - 0.5)
    weight = 1 + 5 * np.abs(mask.mean(axes, keepdims=True) - mask)
    total = weight.sum(axes, keepdims=True)
    share = weight / total
    rise = np.exp(-np.abs(logit))
    found = np.where(logit >= 0, 1 / (1 + rise), rise / (1 + rise))
    entropy = np.maximum(logit, 0) - logit * mask + np.log1p(rise)
    both = (share * found * mask).sum(axes, keepdims=True) + 1 / total
    either = (share * (found + mask - found * mask)).sum(axes, keepdims=True) + 1 / total
    value = (share * entropy).sum(axes, keepdims=True) + 1 - both / either
    steep = 4 * rise / np.square(1 + rise)
    slope = share * (
        4 * (found - mask) - steep * mask / either + both / either**2 * steep * (1 - mask)
    )
    # Rounding of p moves its logit four times as far.
    moved = 4 * (np.abs(predicted) + 0.5)
    size = (share * (entropy + moved + 2)).sum(axes) + 2
    slope_size = share * (8 + steep * moved * (1 + 1 / either) + steep * (1 + 2 / either))
    return value[:, 0, 0, 0], size, [(slope, slope, slope_size)]


def _shading_l1(mask: np.ndarray, precision: Precision) -> Outcome:
    shadings = [x for x in _SHADINGS if precision.holds(x)]
    predicted, shading = pairs(_PREDICTED, shadings)
    return judged(
        _shading_loss,
        _shading_l1_reference,
        precision,
        fields(predicted),
        repeated(mask, len(predicted)),
        fields(shading),
    )


def _shading_l1_reference(
    precision: Precision, predicted: np.ndarray, mask: np.ndarray, shading: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    target = np.log1p(shading)
    size = np.abs(predicted) + np.abs(target)
    difference = predicted - target
    low, high = signs(difference, size, precision)
    weights = mask / np.maximum(mask.sum((1, 2, 3), keepdims=True), 1e-30)
    value = (np.abs(difference) * weights).sum((1, 2, 3))
    return value, (size * weights).sum((1, 2, 3)), [(low * weights, high * weights, weights)]


def _albedos() -> list[np.ndarray]:
    """Return predicted and true albedos, `(N, 3)` each."""
    albedo, predicted = pairs((0.0, 1.0), (-30.0, 0.0, 1e-7, 1.0, 1e4))
    return [values[:, None] * np.array([1.0, 0.5, 0.25]) for values in (predicted, albedo)]


def _albedo_reference(
    precision: Precision, predicted: np.ndarray, albedo: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    difference, size = predicted - albedo, np.abs(predicted) + np.abs(albedo)
    slope = 2 * difference / 3
    value = np.array([np.square(d).sum() / 3 for d in difference])
    return value, 2 * (size * np.abs(difference)).mean(-1), [(slope, slope, 2 * size / 3)]


def _albedo_l1_reference(
    precision: Precision, predicted: np.ndarray, albedo: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    difference, size = predicted - albedo, np.abs(predicted) + np.abs(albedo)
    low, high = signs(difference, size, precision)
    third = np.full_like(difference, 1 / 3)
    return np.abs(difference).mean(-1), size.mean(-1), [(low / 3, high / 3, third)]
