"""The gloss of a material in words, and how sure its exponent is.

The words name the sharpness of a reflection. Its strength is the specular albedo, so a material of
a small m_s looks dull even where its exponent is called glossy.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from lime_keras.optics import shininess

WORDS = ("matte", "satin", "glossy", "mirror-like")
"""Names of four equal ranges of log10 s, two bins each: below s = 5.6, 32, 178, and above."""
_WORD_WIDTH = (shininess.LOG_HIGH - shininess.LOG_LOW) / len(WORDS)
SHARE = 0.8
"""Probability that the exponent lies in its interval."""
FLAT = 1.4
"""Width of the interval in decades from which the probabilities count as nearly flat.

Flat ones have 2.4. On 512 scenes held out from training, of natural materials, a word is wrong for
71 % of the intervals above the limit and for 33 % of those below with `best`, 37 % with `live`; at
1.6 more than half of the words below would be wrong with `best` (`benchmarks/cautions.py`).
"""


def word(exponent: float) -> str:
    """Return the word for an exponent s of at least 0; s below 1 is matte, above 1000 mirror-like.

    Example:
        >>> word(20.0)
        'satin'
    """
    place = (math.log10(max(exponent, 1e-9)) - shininess.LOG_LOW) / _WORD_WIDTH
    return WORDS[min(max(math.floor(place), 0), len(WORDS) - 1)]


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


def is_flat(ends: Sequence[float]) -> bool:
    """Return whether an interval `(low, high)` of s is so wide that no word is sure."""
    return math.log10(ends[1] / ends[0]) >= FLAT


def in_words(exponent: float, ends: Sequence[float] | None) -> str:
    """Return the word for a gloss, or the range of words where it is uncertain.

    Args:
        exponent: s, at least 0.
        ends: `interval` of s; None if no probabilities are known.

    Example:
        >>> in_words(20.0, (2.0, 500.0))
        'uncertain: matte to mirror-like'
    """
    if ends is None or not is_flat(ends):
        return word(exponent)
    return f"uncertain: {word(ends[0])} to {word(ends[1])}"


def sentence(exponent: float, ends: Sequence[float] | None) -> str:
    """Return the gloss in words with its numbers.

    Args:
        exponent: s, at least 0.
        ends: `interval` of s; None if no probabilities are known.

    Example:
        >>> sentence(20.0, (8.0, 50.0))
        'satin, s 20 (8.0 to 50)'
        >>> sentence(20.0, (2.0, 500.0))
        'gloss uncertain: matte to mirror-like, s 20 (2.0 to 500)'
    """
    said = f"{in_words(exponent, ends)}, s {_digits(exponent)}"
    if ends is None:
        return said
    between = f"({_digits(ends[0])} to {_digits(ends[1])})"
    return f"{'gloss ' if is_flat(ends) else ''}{said} {between}"


def _digits(exponent: float) -> str:
    return f"{exponent:.0f}" if exponent >= 9.95 else f"{exponent:.1f}"
