"""Cases for the measures of Table 1 with empty masks or black layers."""

import functools

import numpy as np

from lime_keras import metrics
from lime_keras.eval.stability.verdicts import Case, Outcome

from ..precisions import NUMPY_DOUBLE, NUMPY_SINGLE, Precision

_SHAPE = (2, 6, 5, 1)
_EMPTY, _FULL = np.zeros(_SHAPE), np.ones(_SHAPE)
_ONE = np.zeros(_SHAPE)
_ONE[:, 2, 3] = 1.0
# True mask, predicted mask, intersection over union.
_MASKS = {
    "both masks empty": (_EMPTY, _EMPTY, 1.0),
    "both masks full": (_FULL, _FULL, 1.0),
    "both masks one pixel": (_ONE, _ONE, 1.0),
    "empty mask, one pixel found": (_EMPTY, _ONE, 0.0),
    "one-pixel mask, nothing found": (_ONE, _EMPTY, 0.0),
    "one-pixel mask, all found": (_ONE, _FULL, 1 / 30),
    "mask of exactly one half": (0.5 * _FULL, _FULL, 1.0),
}
# Mask, shading, prediction, Σ|prediction − shading| / Σ shading; None where there is no error.
_LAYERS = {
    "empty mask": (_EMPTY, _FULL, 2 * _FULL, None),
    "one pixel": (_ONE, _FULL, 1.5 * _FULL, 0.5),
    "radiance 1e-8": (_FULL, 1e-8 * _FULL, 2e-8 * _FULL, 1.0),
    "radiance 65504": (_FULL, 65504 * _FULL, 0 * _FULL, 1.0),
    "radiance 1e30": (_FULL, 1e30 * _FULL, 0 * _FULL, 1.0),
    "black layer, answered with black": (_FULL, _EMPTY, _EMPTY, None),
    "black layer, answered with 1": (_FULL, _EMPTY, _FULL, None),
    "black layer, answered with 1e30": (_FULL, _EMPTY, 1e30 * _FULL, None),
    "radiance 1e-20, answered with 1": (_FULL, 1e-20 * _FULL, _FULL, None),
}


def cases() -> list[Case]:
    """Return the cases of the measures."""
    out = []
    for precision in (NUMPY_SINGLE, NUMPY_DOUBLE):
        for name, masks in _MASKS.items():
            measure = functools.partial(_overlap, *masks, precision)
            out.append(Case("measures", f"overlap of masks, {name}", precision.name, measure))
        for name, layer in _LAYERS.items():
            measure = functools.partial(_relative, *layer, precision)
            out.append(Case("measures", f"relative error, {name}", precision.name, measure))
    return out


def _overlap(
    mask: np.ndarray, predicted: np.ndarray, right: float, precision: Precision
) -> Outcome:
    found, _ = precision.evaluate(_iou, mask, predicted)
    return Outcome(precision.compare(found, right, right, right))


def _iou(mask: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    return metrics.overlap_ratio(*metrics.overlap(mask, predicted))


def _relative(
    mask: np.ndarray,
    shading: np.ndarray,
    predicted: np.ndarray,
    error: float | None,
    precision: Precision,
) -> Outcome:
    """Try the mean of an example and of another, whose error is 0.5 and alone may count."""

    def mean(*images: np.ndarray) -> np.ndarray:
        errors, lit = metrics.masked_relative_error(*images)
        return metrics.mean_where_lit(np.mean(errors), np.mean(lit))

    with_another = (
        np.concatenate(pair) for pair in ((shading, _FULL), (predicted, 1.5 * _FULL), (mask, _FULL))
    )
    found, _ = precision.evaluate(mean, *with_another)
    right = 0.5 if error is None else (error + 0.5) / 2
    return Outcome(precision.compare(found, right, right, right, terms=mask[0].size))
