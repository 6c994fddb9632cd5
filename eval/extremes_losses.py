"""The masked mean, Eq. 4 and the losses on images, under every mask and at every level.

The references are the losses' definitions for chosen pixels, in double precision, with the
derivatives worked out by hand.
"""

import functools
import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from lime_keras import colour, compositing, losses, masking

from .precisions import NUMPY_SINGLE, ROUNDINGS, TENSORS, Precision
from .verdicts import Case, Outcome, joined

_HEIGHT, _WIDTH = 4, 5
_PIXELS = _HEIGHT * _WIDTH
_PREDICTED = (-1e4, 0.0, 1.0, 11.0, 1e4)
_SHADINGS = (0.0, 1e-30, 1.0, 65504.0, 1e30)
_PHOTOS = (0.0, 1e-7, 0.04045, 0.5, 0.99, 1.0)
_MATERIALS = ((0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (-30.0, 30.0))  # m_d, m_s
_ANSWERS = (-1e4, 0.0, 1e-7, 1.0, 10.0, 11.5, 1e4)  # compressed S

Slopes = list[tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Of each argument, the least and most that a derivative may be, and its size."""
Reference = Callable[..., tuple[np.ndarray, np.ndarray, Slopes]]
"""From a precision and rounded arguments to values `(B,)`, their sizes, and slopes."""


def cases() -> list[Case]:
    """Every case of these parts."""
    out = []
    for precision in TENSORS:
        for name, mask in _masks().items():
            for part, measure in _MASKED.items():
                measure = functools.partial(measure, mask, precision)
                out.append(Case(part, f"{name} mask", precision.name, measure))
        measure = functools.partial(_albedo, precision)
        out.append(Case("loss on albedos", "albedos from -30 to 10000", precision.name, measure))
    for precision in (*TENSORS, NUMPY_SINGLE):
        measure = functools.partial(_large_mask, precision)
        out.append(Case("masked mean", "full mask of 256 × 256", precision.name, measure))
        for albedo, shading in itertools.product((1.0, 30.0), (*_SHADINGS, 1e8)):
            if precision.holds(shading) and precision.holds(albedo * shading):
                measure = functools.partial(_composed, albedo, shading, precision)
                name = f"albedos up to {albedo:g} either way, shading {shading:g}"
                out.append(Case("Eq. 4", name, precision.name, measure))
    return out


@functools.cache
def _masks() -> dict[str, np.ndarray]:
    """Coverages `(4, 5, 1)` by name."""
    full = np.ones((_HEIGHT, _WIDTH, 1))
    one = np.zeros_like(full)
    one[1, 2] = 1.0
    return {"empty": 0 * full, "one-pixel": one, "faint one-pixel": one / 255, "full": full}


def _judged(
    function: Callable[..., Any], reference: Reference, precision: Precision, *arguments: np.ndarray
) -> Outcome:
    """A loss and its gradients by its arguments, as far as the reference has them."""
    found, gradients = precision.evaluate(function, *arguments)
    right, size, slopes = reference(precision, *map(precision.rounded, arguments))
    # Losses add up in single precision at least, and every sum here is over an image.
    value = precision.compare(found, right, right, size, terms=_PIXELS)
    if gradients is None:
        return Outcome(value)
    by_argument = [
        precision.compare(gradient, *slope, terms=_PIXELS)
        for gradient, slope in zip(gradients, slopes, strict=False)
    ]
    return Outcome(value, joined(by_argument))


def _fields(levels: Any) -> np.ndarray:
    """An uneven image `(B, 4, 5, 1)` of each of B levels."""
    pattern = np.random.default_rng(0).uniform(0.5, 1, (_HEIGHT, _WIDTH, 1))
    # Where the one-pixel mask looks too, the level is exact.
    pattern[0, 0] = pattern[1, 2] = 1.0
    return np.reshape(levels, (-1, 1, 1, 1)) * pattern


def _repeated(mask: np.ndarray, count: int) -> np.ndarray:
    return np.broadcast_to(mask, (count, *mask.shape))


def _pairs(first: Any, second: Any) -> tuple[np.ndarray, np.ndarray]:
    """Each of the first with each of the second, in two rows."""
    a, b = np.meshgrid(first, second, indexing="ij")
    return a.ravel(), b.ravel()


# What is tried, the arguments that are differentiated by first. Looked up in the library when it
# is run, so that a test may put something broken there.


def _mean(values: Any, mask: Any) -> Any:
    return masking.masked_mean(values, mask)


def _mask_loss(predicted: Any, mask: Any) -> Any:
    return losses.mask_l2(mask, predicted)


def _shading_loss(predicted: Any, mask: Any, shading: Any) -> Any:
    return losses.shading_l1(shading, predicted, mask)


def _albedo_loss(predicted: Any, albedo: Any) -> Any:
    return losses.albedo_l2(albedo, predicted)


def _compose(*arguments: Any) -> Any:
    return compositing.compose(*arguments)


def _compositing_loss(
    m_d: Any, m_s: Any, m_a: Any, compressed: Any, image: Any, mask: Any, diffuse: Any
) -> Any:
    return losses.compositing_l1(image, mask, m_d, m_s, m_a, diffuse, compressed)


# The masked mean.


def _masked_mean(mask: np.ndarray, precision: Precision) -> Outcome:
    """With NaN wherever nothing is covered."""
    levels = [x for x in (0.0, 1.0, -1e4, 65504.0, 1e30) if precision.holds(x)]
    values = np.where(mask > 0, _fields(levels), np.nan)
    return _judged(
        _mean,
        _masked_mean_reference,
        precision,
        values,
        _repeated(mask, len(levels)),
    )


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
    """More pixels than float16's largest number."""
    shape = (1, 256, 256, 1)
    found, gradients = precision.evaluate(_mean, np.full(shape, 3.0), np.ones(shape))
    value = precision.compare(found, 3.0, 3.0, 3.0, terms=256 * 256)
    if gradients is None:
        return Outcome(value)
    slope = 1 / (256 * 256)
    return Outcome(value, precision.compare(gradients[0], slope, slope, slope))


# Losses under a mask.


def _mask_l2(mask: np.ndarray, precision: Precision) -> Outcome:
    return _judged(
        _mask_loss,
        _mask_l2_reference,
        precision,
        _fields(_PREDICTED),
        _repeated(mask, len(_PREDICTED)),
    )


def _mask_l2_reference(
    precision: Precision, predicted: np.ndarray, mask: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    difference = predicted - mask
    slope = 2 * difference / _PIXELS
    size = (np.abs(predicted) + np.abs(mask)) * np.abs(difference)
    value = np.array([np.square(d).sum() / _PIXELS for d in difference])
    slope_size = 2 * (np.abs(predicted) + np.abs(mask)) / _PIXELS
    return value, 2 * size.mean((1, 2, 3)), [(slope, slope, slope_size)]


def _shading_l1(mask: np.ndarray, precision: Precision) -> Outcome:
    shadings = [x for x in _SHADINGS if precision.holds(x)]
    predicted, shading = _pairs(_PREDICTED, shadings)
    return _judged(
        _shading_loss,
        _shading_l1_reference,
        precision,
        _fields(predicted),
        _repeated(mask, len(predicted)),
        _fields(shading),
    )


def _shading_l1_reference(
    precision: Precision, predicted: np.ndarray, mask: np.ndarray, shading: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    target = np.log1p(shading)
    size = np.abs(predicted) + np.abs(target)
    difference = predicted - target
    low, high = _signs(difference, size, precision)
    weights = mask / np.maximum(mask.sum((1, 2, 3), keepdims=True), 1e-30)
    value = (np.abs(difference) * weights).sum((1, 2, 3))
    return value, (size * weights).sum((1, 2, 3)), [(low * weights, high * weights, weights)]


def _signs(
    difference: np.ndarray, size: np.ndarray, precision: Precision
) -> tuple[np.ndarray, np.ndarray]:
    """Least and most that the derivative of |difference| may be; either sign where it is 0."""
    doubtful = np.abs(difference) <= ROUNDINGS * (precision.epsilon * size + precision.least)
    return np.where(doubtful, -1, np.sign(difference)), np.where(doubtful, 1, np.sign(difference))


def _albedo(precision: Precision) -> Outcome:
    albedo, predicted = _pairs((0.0, 1.0), (-30.0, 0.0, 1e-7, 1.0, 1e4))
    scale = np.array([1.0, 0.5, 0.25])
    return _judged(
        _albedo_loss,
        _albedo_reference,
        precision,
        predicted[:, None] * scale,
        albedo[:, None] * scale,
    )


def _albedo_reference(
    precision: Precision, predicted: np.ndarray, albedo: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    difference, size = predicted - albedo, np.abs(predicted) + np.abs(albedo)
    slope = 2 * difference / 3
    value = np.array([np.square(d).sum() / 3 for d in difference])
    return value, 2 * (size * np.abs(difference)).mean(-1), [(slope, slope, 2 * size / 3)]


# Eq. 4 and Eq. 5.


def _composed(albedo: float, shading: float, precision: Precision) -> Outcome:
    """m_a + m_d D + m_s S for all signs of the albedos, D as bright as S."""
    m_d, m_s = _pairs((-albedo, 0.0, albedo), (-albedo, 0.0, albedo))
    return _judged(
        _compose,
        _composed_reference,
        precision,
        m_d[:, None] * np.array([1.0, 0.5, 0.25]),
        m_s,
        np.full(len(m_s), 0.02),
        _fields(np.full(len(m_s), shading)),
        _fields(np.full(len(m_s), shading))[:, ::-1],
    )


def _composed_reference(
    precision: Precision,
    m_d: np.ndarray,
    m_s: np.ndarray,
    m_a: np.ndarray,
    diffuse: np.ndarray,
    specular: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    m_d, m_s, m_a = m_d[:, None, None], m_s[:, None, None, None], m_a[:, None, None, None]
    value = m_a + m_d * diffuse + m_s * specular
    size = np.abs(m_a) + np.abs(m_d) * diffuse + np.abs(m_s) * specular
    by_diffuse = diffuse.sum((1, 2)) * np.ones(3)
    by_specular = 3 * specular.sum((1, 2, 3))
    by_ambient = np.full(len(m_s), 3.0 * _PIXELS)
    by_d, by_s = (
        m_d.sum(-1, keepdims=True) * np.ones_like(diffuse),
        3 * m_s * np.ones_like(specular),
    )
    slopes = (by_diffuse, by_specular, by_ambient, by_d, by_s)
    return value, size, [(slope, slope, slope) for slope in slopes]


def _compositing_l1(mask: np.ndarray, precision: Precision) -> Outcome:
    """All photos with all materials and all answers for S."""
    photo, material = _pairs(_PHOTOS, range(len(_MATERIALS)))
    m_d, m_s = np.array(_MATERIALS)[_pairs(material, _ANSWERS)[0]].T
    photo, answer = _pairs(photo, _ANSWERS)
    count = len(photo)
    return _judged(
        _compositing_loss,
        _compositing_l1_reference,
        precision,
        m_d[:, None] * np.array([1.0, 0.5, 0.25]),
        m_s[:, None],
        np.full(count, 0.02),
        _fields(answer),
        np.repeat(_fields(photo), 3, axis=-1),
        _repeated(mask, count),
        _fields(np.full(count, 2.0)),
    )


def _compositing_l1_reference(
    precision: Precision,
    m_d: np.ndarray,
    m_s: np.ndarray,
    m_a: np.ndarray,
    answer: np.ndarray,
    image: np.ndarray,
    mask: np.ndarray,
    diffuse: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, Slopes]:
    compressed = np.clip(answer, 0, 11)
    specular, by_answer = np.expm1(compressed), np.exp(compressed)
    m_d, m_s = m_d[:, None, None], m_s[:, None, None]
    composed = m_a[:, None, None, None] + m_d * diffuse + m_s * specular
    # A relative error of the answer makes itself felt as answer × derivative.
    answered = specular + compressed * by_answer
    size = np.abs(m_d) * diffuse + np.abs(m_s) * answered + 1.0
    linear = np.where(image > 0.04045, ((image + 0.055) / 1.055) ** 2.4, image / 12.92)
    low, high = _signs(composed - linear, size, precision)
    clipped = image >= precision.rounded(colour.CLIPPED)
    error = np.where(clipped, np.maximum(linear - composed, 0), np.abs(composed - linear))
    low, high = (
        np.minimum(low, np.where(clipped, 0, 1)),
        np.where(clipped, np.minimum(high, 0), high),
    )
    share = (mask >= 1) / np.maximum(3.0 * (mask >= 1).sum((1, 2, 3), keepdims=True), 1)
    low, high = low * share, high * share
    value, size = (error * share).sum((1, 2, 3)), (size * share).sum((1, 2, 3))

    def chained(factor: np.ndarray, axes: tuple[int, ...]) -> Any:
        """The derivative by what enters the composition with this factor."""
        ends = np.stack([low * factor, high * factor])
        magnitude = (np.maximum(np.abs(low), np.abs(high)) * np.abs(factor)).sum(axes)
        return ends.min(0).sum(axes), ends.max(0).sum(axes), magnitude

    inside = (answer > 0) & (answer < 11)
    low_d, high_d, size_d = chained(diffuse, (1, 2))
    by_specular = chained(np.broadcast_to(specular, low.shape), (1, 2, 3))
    size_s = chained(np.broadcast_to(answered, low.shape), (1, 2, 3))[2]
    by_ambient = chained(np.ones_like(low), (1, 2, 3))
    steep = m_s * by_answer * np.ones_like(low)
    low_c, high_c, size_c = (x[..., None] for x in chained(steep * inside, (3,)))
    # At 0 and at the ceiling the curve has a kink.
    kink = (answer == 0) | (answer == 11)
    low_k, high_k, size_k = (x[..., None] for x in chained(steep * kink, (3,)))
    size_c = (size_c + size_k) * (1 + compressed)
    return (
        value,
        size,
        [
            (low_d, high_d, size_d),
            (by_specular[0][:, None], by_specular[1][:, None], size_s[:, None]),
            by_ambient,
            (low_c + np.minimum(low_k, 0), high_c + np.maximum(high_k, 0), size_c),
        ],
    )


_MASKED: dict[str, Callable[[np.ndarray, Precision], Outcome]] = {
    "masked mean": _masked_mean,
    "loss on masks": _mask_l2,
    "loss on shading": _shading_l1,
    "compositing loss": _compositing_l1,
}
