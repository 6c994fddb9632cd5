"""The gloss of a material in words, and how likely they are.

Gloss is sharpness and strength. The level of a material is log10 s, lowered where the specular
albedo is below that of a plastic: a sharp lobe of no strength is not glossy. An estimate gets the
side that is more likely, matte or glossy, and how likely that is: networks draw what they are not
sure of towards the middle of the scale, so that s alone would call most things satin.

How likely a level makes either side was counted for each set of weights on rendered scenes
(`benchmarks/gloss.py`); the two numbers lie beside the weights (`lime_keras.model.gloss_file`).
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lime_keras.optics import shininess

WORDS = ("matte", "satin", "semi-gloss", "glossy", "high-gloss")
"""Words of the trade; with m_s of a plastic they begin at s = 0, 32, 75, 178 and 422."""
_EDGES = (1.5, 1.875, 2.25, 2.625)  # levels where words change: edges of the bins of s
SIDE = 1.875  # level from which a material is on the glossy side: semi-gloss, glossy or high-gloss
PLASTIC = 0.04  # specular albedo of a smooth plastic, glaze or varnish, of refractive index 1.5
MIRROR = 0.3  # specular albedo from which what is glossy mirrors: metals and what is silvered
EVEN, SURE = 0.6, 0.85
"""Probability of a side from which it is said, and from which it is said without a number."""
SHARE = 0.8  # probability that the exponent lies in its interval


class Calibration(NamedTuple):
    """The probability that an estimated level is glossy: 1 / (1 + exp(−slope · (level − even))).

    Attributes:
        even: level at which both sides are as likely.
        slope: growth of the log-odds with a decade of s.
    """

    even: float
    slope: float

    def probability(self, exponent: float, specular_albedo: float | None) -> float:
        """Return the probability in [0, 1] that a material is glossy, from its estimate.

        Args:
            exponent: estimated s, at least 0.
            specular_albedo: estimated m_s, at least 0; None counts as a plastic's.
        """
        odds = self.slope * (level(exponent, specular_albedo) - self.even)
        return 1 / (1 + math.exp(min(max(-odds, -700), 700)))


DEFAULT = Calibration(1.6, 3.0)
"""The calibration of a model without one of its own: near those of the sets that ship."""


def level(exponent: float, specular_albedo: float | None = None) -> float:
    """Return the level of gloss: log10 s, and log10(m_s / `PLASTIC`) more where that is below 0.

    Args:
        exponent: s, at least 0.
        specular_albedo: m_s, at least 0; None counts as a plastic's.

    Example:
        >>> level(100.0), round(level(100.0, 0.004), 6), level(100.0, 0.9)
        (2.0, 1.0, 2.0)
    """
    strength = PLASTIC if specular_albedo is None else specular_albedo
    return math.log10(max(exponent, 1e-9)) + math.log10(min(max(strength, 1e-9) / PLASTIC, 1.0))


def word(exponent: float, specular_albedo: float | None = None) -> str:
    """Return the word for a material that is known, such as a rendered one (arguments: `level`).

    Example:
        >>> word(60.0, 0.05), word(250.0, 0.05), word(250.0, 0.004), word(250.0, 0.9)
        ('satin', 'glossy', 'matte', 'mirror-like')
    """
    place = int(np.searchsorted(_EDGES, level(exponent, specular_albedo), side="right"))
    is_mirror = specular_albedo is not None and specular_albedo >= MIRROR
    return "mirror-like" if is_mirror and place >= WORDS.index("glossy") else WORDS[place]


def describe(probability: float, exponent: float, specular_albedo: float | None) -> str:
    """Return the words for an estimated gloss: the likelier side, or both where that is even.

    Args:
        probability: that the material is glossy, in [0, 1] (`Calibration.probability`).
        exponent: estimated s, at least 0.
        specular_albedo: estimated m_s, at least 0; None if it is not known.

    Example:
        >>> describe(0.81, 70.0, 0.05), describe(0.2, 9.0, 0.05), describe(0.5, 40.0, 0.05)
        ('rather glossy (81 %)', 'rather matte (80 %)', 'satin to semi-gloss')
        >>> describe(0.9, 250.0, 0.05), describe(0.1, 3.0, 0.05)
        ('glossy', 'matte or satin')
    """
    likely = max(probability, 1 - probability)
    if likely < EVEN:
        return "satin to semi-gloss"
    if likely < SURE:
        return f"rather {'glossy' if probability > 0.5 else 'matte'} ({100 * likely:.0f} %)"
    if probability < 0.5:
        return "matte or satin"
    finer = word(exponent, specular_albedo)
    return finer if finer in ("high-gloss", "mirror-like") else "glossy"


def interval(probabilities: Any) -> tuple[float, float]:
    """Return the exponents between which s lies with probability `SHARE`, with equal tails.

    Inside a bin every log10 s is equally likely, as in the law that the bins were learnt from.

    Args:
        probabilities: `(8,)`, at least 0, of the eight bins; they sum to 1.

    Example:
        >>> low, high = interval(np.full(8, 1 / 8))
        >>> round(low, 1), round(high)
        (2.0, 501)
    """
    reached = np.concatenate([[0.0], np.cumsum(probabilities, dtype=np.float64)])
    tail = (1 - SHARE) / 2
    ends = []
    for target in (tail * reached[-1], (1 - tail) * reached[-1]):
        # The first bin in which the target is reached; its probability is not 0.
        bin_ = int(np.searchsorted(reached[1:], target))
        inside = (target - reached[bin_]) / (reached[bin_ + 1] - reached[bin_])
        ends.append(float(10.0 ** (shininess.LOG_EDGES[bin_] + inside * shininess.BIN_WIDTH)))
    return ends[0], ends[1]


def numbers(exponent: float, ends: Sequence[float] | None) -> str:
    """Return an exponent with its interval.

    Args:
        exponent: s, at least 0.
        ends: `interval` of s; None if no probabilities are known.

    Example:
        >>> numbers(20.0, (8.0, 50.0))
        's 20 (8.0 to 50)'
    """
    between = "" if ends is None else f" ({_digits(ends[0])} to {_digits(ends[1])})"
    return f"s {_digits(exponent)}{between}"


def _digits(exponent: float) -> str:
    return f"{exponent:.0f}" if exponent >= 9.95 else f"{exponent:.1f}"
