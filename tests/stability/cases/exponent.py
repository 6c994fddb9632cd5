"""Cases for the exponent: its bins, their probabilities, and its losses."""

import functools
import math
from typing import Any

import mpmath
import numpy as np
from keras import ops

from lime_keras import losses
from lime_keras.eval.stability.verdicts import Case, Compared, Outcome
from lime_keras.optics import shininess
from lime_keras.optics.shininess import BIN_COUNT, BIN_WIDTH

from ..images import pairs
from ..precisions import NUMPY_DOUBLE, NUMPY_SINGLE, SINGLE, TENSORS, Precision
from ..refusals import refusal

_EVEN = np.zeros(BIN_COUNT)
_LOGITS = {
    "all 0": _EVEN,
    "true class at 1e4": 1e4 * np.eye(BIN_COUNT)[2],
    "wrong class at 1e4": 1e4 * np.eye(BIN_COUNT)[5],
    "true class at -1e4": -1e4 * np.eye(BIN_COUNT)[2],
    "all others at -1e4": -1e4 * (1 - np.eye(BIN_COUNT)[2]),
    "true class at 1e4, wrong at -1e4": 1e4 * (np.eye(BIN_COUNT)[2] - np.eye(BIN_COUNT)[5]),
    "true class at -1e4, wrong at 1e4": 1e4 * (np.eye(BIN_COUNT)[5] - np.eye(BIN_COUNT)[2]),
    "two classes at 1e4": 1e4 * (np.eye(BIN_COUNT)[2] + np.eye(BIN_COUNT)[5]),
    "all at 1e4": 1e4 + _EVEN,
    "all at -1e4": -1e4 + _EVEN,
    "wrong class 10 ahead": 10 * np.eye(BIN_COUNT)[5],
    "wrong class 15 ahead": 15 * np.eye(BIN_COUNT)[5],
    "wrong class 20 ahead": 20 * np.eye(BIN_COUNT)[5],
    "wrong class 100 ahead": 100 * np.eye(BIN_COUNT)[5],
    "all wrong classes 1000 ahead": 1000 * (1 - np.eye(BIN_COUNT)[2]),
}
_TRUE = 2
_PROBABILITIES = {
    "certain": np.eye(BIN_COUNT)[2],
    "certain of another": np.eye(BIN_COUNT)[5],
    "even": np.full(BIN_COUNT, 1 / BIN_COUNT),
    "1e-30 left": np.where(np.arange(BIN_COUNT) == 2, 1.0, 1e-30),
}
_EXPONENTS = {
    "0": (0.0, 0),
    "-0": (-0.0, 0),
    "1e-38": (1e-38, 0),
    "just below 1": (1 - 1e-4, 0),
    "1": (1.0, 0),
    "just below 1000": (999.9, BIN_COUNT - 1),
    "1000": (1000.0, BIN_COUNT - 1),
    "1e6": (1e6, BIN_COUNT - 1),
    "infinity": (math.inf, BIN_COUNT - 1),
} | {
    f"{side} edge {k}": (10 ** (BIN_WIDTH * k) * factor, k - (factor < 1))
    for k in range(1, BIN_COUNT)
    for side, factor in (("at", 1.0), ("just below", 1 - 1e-4))
}


def cases() -> list[Case]:
    """Return the cases of softmax, the losses on the exponent, and its bins."""
    out = []
    for precision in TENSORS:
        for name in _LOGITS:
            for part, measure in (("softmax", _softmax), ("cross-entropy", _cross_entropy)):
                measure = functools.partial(measure, name, precision)
                out.append(Case(part, f"logits: {name}", precision.name, measure))
        measure = functools.partial(_log_loss, precision)
        out.append(Case("loss on log s", "s from 0 to 65504", precision.name, measure))
    for name in _PROBABILITIES:
        for precision in (*TENSORS, NUMPY_SINGLE):
            measure = functools.partial(_expected, name, precision)
            out.append(Case("expected log s", name, precision.name, measure))
        measure = functools.partial(_entropy, name)
        out.append(Case("entropy", name, NUMPY_DOUBLE.name, measure))
    for name, (s, index) in _EXPONENTS.items():
        for precision in (NUMPY_SINGLE, NUMPY_DOUBLE):
            if precision.holds(s):
                measure = functools.partial(_bin, s, index, precision)
                out.append(Case("bins", f"s = {name}", precision.name, measure))
    for name, s in {"NaN": math.nan, "-1e-9": -1e-9, "-infinity": -math.inf}.items():
        measure = functools.partial(_refused, s)
        out.append(Case("bins", f"s = {name} refused", NUMPY_DOUBLE.name, measure))
    return out


def _rows(values: np.ndarray) -> np.ndarray:
    """Repeat the values in five rows, enough for vectorised loops."""
    return np.tile(values, (5, 1))


def _exact_softmax(logits: np.ndarray) -> np.ndarray:
    """Return the softmax `(8,)` of logits, computed without underflow."""
    with mpmath.workdps(50):
        powers = [mpmath.exp(mpmath.mpf(float(x))) for x in logits]
        return np.array([float(power / sum(powers)) for power in powers])


# Softmax and cross-entropy.


def _probability(logits: Any) -> Any:
    """Compute the probability of the true class, which the loss depends on."""
    return ops.softmax(logits)[:, _TRUE]


def _loss(logits: Any) -> Any:
    """Compute the cross-entropy as in the networks: of logits in float32 in every precision."""
    bins = np.full(5, _TRUE, np.int32)
    return losses.exponent_cross_entropy(bins, ops.cast(logits, "float32"))


def _softmax(name: str, precision: Precision) -> Outcome:
    """Try the probability p of the true class, whose derivatives are p (1 − p) and −p q."""
    logits = precision.rounded(_LOGITS[name])
    found, gradients = precision.evaluate(_probability, _rows(logits))
    p = _exact_softmax(logits)
    # An absolute error of a logit difference is a relative error of the probability.
    size = p * (1 + np.abs(logits - logits.max()))
    slope = p[_TRUE] * (np.eye(BIN_COUNT)[_TRUE] - p)
    magnitude = p[_TRUE] * (np.eye(BIN_COUNT)[_TRUE] + p) + size[_TRUE] + size
    return Outcome(
        precision.compare(found, p[_TRUE], p[_TRUE], size[_TRUE], terms=BIN_COUNT),
        precision.compare(gradients[0], slope, slope, magnitude, terms=BIN_COUNT),
    )


def _cross_entropy(name: str, precision: Precision) -> Outcome:
    """Try −ln p, however small p is, and its derivative, which is 1 − p for the true class."""
    logits = precision.rounded(_LOGITS[name])
    found, gradients = precision.evaluate(_loss, _rows(logits))
    with mpmath.workdps(50):
        total = sum(mpmath.exp(mpmath.mpf(float(x)) - float(logits[_TRUE])) for x in logits)
        right = float(mpmath.log(total))
    p = _exact_softmax(logits)
    slope = p - np.eye(BIN_COUNT)[_TRUE]
    # The relative error of a power is the absolute error of its logit's distance to the largest.
    size = p * (1 + np.abs(logits - logits.max()))
    return Outcome(
        SINGLE.compare(found, right, right, 1 + right, terms=BIN_COUNT),
        precision.compare(gradients[0], slope, slope, 1 + size, terms=BIN_COUNT),
    )


def _squared_loss(predicted: Any, true: Any) -> Any:
    return losses.squared(true, predicted)


def _log_loss(precision: Precision) -> Outcome:
    logs, predicted = pairs((0.0, 1.0, 3.0, 4.8), (-100.0, 0.0, 1.5, 3.0, 100.0))
    found, gradients = precision.evaluate(_squared_loss, predicted[:, None], logs[:, None])
    log = precision.rounded(logs)
    answer = precision.rounded(predicted)
    size = np.abs(answer) + log + 1
    slope, right = 2 * (answer - log), (answer - log) ** 2
    return Outcome(
        precision.compare(found, right, right, size * (abs(slope) + size * precision.epsilon)),
        precision.compare(gradients[0][:, 0], slope, slope, 2 * size),
    )


# Bins.


def _expected(name: str, precision: Precision) -> Outcome:
    """Try the expected log10 s, Σ p · w (k + ½) for bins of width w that start at s = 1."""
    means = BIN_WIDTH * (np.arange(BIN_COUNT) + 0.5)
    probabilities = precision.rounded(_PROBABILITIES[name])
    found, gradients = precision.evaluate(_expected_log, _rows(probabilities))
    right = probabilities @ means
    value = precision.compare(found, right, right, right, terms=BIN_COUNT)
    if not gradients:
        return Outcome(value)
    return Outcome(value, precision.compare(gradients[0], means, means, means))


def _expected_log(probabilities: Any) -> Any:
    return shininess.log_expected(probabilities)


def _entropy(name: str) -> Outcome:
    probabilities = _PROBABILITIES[name]
    with mpmath.workdps(50):
        terms = [mpmath.mpf(float(p)) for p in probabilities]
        right = float(-sum(p * mpmath.log(p, 2) for p in terms if p > 0))
    found = shininess.entropy(_rows(probabilities))
    return Outcome(NUMPY_DOUBLE.compare(found, right, right, right, terms=BIN_COUNT))


def _bin(s: float, index: int, precision: Precision) -> Outcome:
    """Try the bin of an exponent, which must be exact."""
    found = shininess.bin_of(np.full(5, precision.array(s)))
    return Outcome(Compared(found, index, index, 0.0))


def _refused(s: float) -> Outcome:
    return refusal(lambda: shininess.bin_of([3.0, s]), "at least 0", "check the material")
