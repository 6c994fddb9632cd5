"""The Blinn–Phong lobe of Eq. 3 and its furnace normalisation.

Letters: `s` is the exponent (shininess, at least 0), `cosine` is h·n.
"""

import math
from typing import Any

from lime_keras.arrays import namespace

_TINY = 1e-15
"""Cosines below count as this one: steeper gradients, squared by Adam, would leave float32."""


def lobe(cosine: Any, exponent: Any) -> Any:
    """`max(cosine, 0) ** exponent`, with 0 for every cosine at or below 0, even at exponent 0.

    Two selects keep the gradient finite at `cosine = 0`, where the power's own is infinite for
    exponents below 1. There is no cosine factor: the lobe of Eq. 3 has none.
    """
    xp = namespace(cosine, exponent)
    lit = cosine > 0
    safe = xp.maximum(xp.where(lit, cosine, 1.0), _TINY)
    return xp.where(lit, xp.exp(exponent * xp.log(safe)), 0.0)


def normaliser(exponent: Any) -> Any:
    """c(s) = (s + 2) / (8π (1 − 2^(−(s+2)/2))), which makes S = 1 in a furnace at n = o.

    Any shape, exponent at least 0. c(0) = 1/(2π); c(s) → (s + 2)/(8π) as s grows.
    """
    xp = namespace(exponent)
    # 1 − 2^(−a) by expm1 keeps its digits; here a is at least 1, so it never cancels to zero.
    spread = -xp.expm1(-(exponent + 2.0) * (0.5 * math.log(2.0)))
    return (exponent + 2.0) / (8.0 * math.pi * spread)
