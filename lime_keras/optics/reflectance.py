"""The furnace normalisation of Eq. 3's Blinn–Phong lobe (h·n)^s; `shading` sums the lobe itself."""

import math
from typing import Any

from lime_keras.arrays import namespace


def normaliser(exponent: Any) -> Any:
    """c(s) = (s + 2) / (8π (1 − 2^(−(s+2)/2))), which makes S = 1 in a furnace at n = o.

    Any shape, exponent at least 0. c(0) = 1/(2π); c(s) → (s + 2)/(8π) as s grows.
    """
    xp = namespace(exponent)
    # 1 − 2^(−a) by expm1 keeps its digits; here a is at least 1, so it never cancels to zero.
    spread = -xp.expm1(-(exponent + 2.0) * (0.5 * math.log(2.0)))
    return (exponent + 2.0) / (8.0 * math.pi * spread)
