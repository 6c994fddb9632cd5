"""Cases for Eq. 4 and the loss of Eq. 5 with extreme materials, photos and predictions."""

import functools
import itertools
from typing import Any

import numpy as np
from keras import ops

from lime_keras import losses
from lime_keras.eval.stability.verdicts import Case, Outcome
from lime_keras.optics import colour, compositing

from .. import srgb_standard
from ..images import PIXELS, Slopes, fields, judged, masks, pairs, repeated, signs
from ..precisions import NUMPY_SINGLE, TENSORS, Precision

_SHADINGS = (0.0, 1e-30, 1.0, 65504.0, 1e8, 1e30)
_PHOTOS = (0.0, 1e-7, 0.04045, 0.5, 0.99, 1.0)
_MATERIALS = np.array([(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (-30.0, 30.0)])  # m_d, m_s
_ANSWERS = (-1e4, 0.0, 1e-7, 1.0, 10.0, 11.5, 1e4)  # compressed S
_TINT = np.array([1.0, 0.5, 0.25])


def cases() -> list[Case]:
    """Return the cases of Eq. 4 and of the compositing loss."""
    out = []
    for precision in (*TENSORS, NUMPY_SINGLE):
        for albedo, shading in itertools.product((1.0, 30.0), _SHADINGS):
            if precision.holds(shading) and precision.holds(albedo * shading):
                measure = functools.partial(_composed, albedo, shading, precision)
                name = f"albedos up to {albedo:g} either way, shading {shading:g}"
                out.append(Case("Eq. 4", name, precision.name, measure))
    for precision in TENSORS:
        for name, mask in masks().items():
            measure = functools.partial(_compositing_l1, mask, precision)
            out.append(Case("compositing loss", f"{name} mask", precision.name, measure))
    return out


# These functions look the library's up at run time, so that a test can replace them by broken ones.


def _compose(*arguments: Any) -> Any:
    return compositing.compose(*arguments)


def _compositing_loss(
    m_d: Any, m_s: Any, m_a: Any, compressed: Any, image: Any, mask: Any, diffuse: Any
) -> Any:
    clipped = ops.cast(image >= colour.CLIPPED, image.dtype)
    return losses.compositing_l1(image, mask, m_d, m_s, m_a, diffuse, compressed, clipped)


def _composed(albedo: float, shading: float, precision: Precision) -> Outcome:
    """Try m_a + m_d D + m_s S with all signs of the albedos, and D as bright as S."""
    m_d, m_s = pairs((-albedo, 0.0, albedo), (-albedo, 0.0, albedo))
    return judged(
        _compose,
        _composed_reference,
        precision,
        m_d[:, None] * _TINT,
        m_s,
        np.full(len(m_s), 0.02),
        fields(np.full(len(m_s), shading)),
        fields(np.full(len(m_s), shading))[:, ::-1],
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
    by_ambient = np.full(len(m_s), 3.0 * PIXELS)
    by_d = m_d.sum(-1, keepdims=True) * np.ones_like(diffuse)
    by_s = 3 * m_s * np.ones_like(specular)
    slopes = (by_diffuse, by_specular, by_ambient, by_d, by_s)
    return value, size, [(slope, slope, slope) for slope in slopes]


def _compositing_l1(mask: np.ndarray, precision: Precision) -> Outcome:
    """Try all photos with all materials and all predictions of S."""
    indices = np.indices((len(_PHOTOS), len(_MATERIALS), len(_ANSWERS))).reshape(3, -1)
    photo, answer = np.array(_PHOTOS)[indices[0]], np.array(_ANSWERS)[indices[2]]
    m_d, m_s = _MATERIALS[indices[1]].T
    count = len(photo)
    return judged(
        _compositing_loss,
        _compositing_l1_reference,
        precision,
        m_d[:, None] * _TINT,
        m_s[:, None],
        np.full(count, 0.02),
        fields(answer),
        np.repeat(fields(photo), 3, axis=-1),
        repeated(mask, count),
        fields(np.full(count, 2.0)),
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
    # A relative error of the prediction changes S by that error times prediction × derivative.
    answered = specular + compressed * by_answer
    size = np.abs(m_d) * diffuse + np.abs(m_s) * answered + 1.0
    linear = srgb_standard.decoded(image)
    low, high = signs(composed - linear, size, precision)
    clipped = image >= precision.rounded(colour.CLIPPED)
    error = np.where(clipped, np.maximum(linear - composed, 0), np.abs(composed - linear))
    # Where the photo is clipped, only a radiance below it is an error.
    low, high = (np.where(clipped, np.minimum(sign, 0), sign) for sign in (low, high))
    share = (mask >= 1) / np.maximum(3.0 * (mask >= 1).sum((1, 2, 3), keepdims=True), 1)
    chained = functools.partial(_chained, low * share, high * share)
    inside = (answer > 0) & (answer < 11)
    # At 0 and at the ceiling the curve has a kink, with a slope of 0 on one side.
    kink = (answer == 0) | (answer == 11)
    steep = m_s * by_answer
    low_in, high_in, size_in = chained(steep * inside, (3,))
    low_kink, high_kink, size_kink = chained(steep * kink, (3,))
    low_s, high_s, _ = chained(specular, (1, 2, 3))
    by_compressed = (
        low_in + np.minimum(low_kink, 0),
        high_in + np.maximum(high_kink, 0),
        (size_in + size_kink) * (1 + compressed[..., 0]),
    )
    slopes: Slopes = [
        chained(diffuse, (1, 2)),
        _columns(low_s, high_s, chained(answered, (1, 2, 3))[2]),
        chained(np.ones(1), (1, 2, 3)),
        _columns(*by_compressed),
    ]
    return (error * share).sum((1, 2, 3)), (size * share).sum((1, 2, 3)), slopes


def _chained(
    low: np.ndarray, high: np.ndarray, factor: np.ndarray, axes: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Apply the chain rule to bounds of a derivative, and sum over axes.

    Args:
        low: least derivative of the loss by the composition.
        high: greatest derivative of the loss by the composition.
        factor: derivative of the composition by the argument.
        axes: axes over which the argument is constant.

    Returns:
        Least derivative, greatest derivative and magnitude, for the argument.
    """
    ends = np.stack([low * factor, high * factor])
    size = np.maximum(np.abs(low), np.abs(high)) * np.abs(factor)
    return ends.min(0).sum(axes), ends.max(0).sum(axes), size.sum(axes)


def _columns(*arrays: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return least derivative, greatest derivative and magnitude with a last axis of length 1."""
    low, high, size = (array[..., None] for array in arrays)
    return low, high, size
