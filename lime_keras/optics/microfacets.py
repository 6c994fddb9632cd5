"""The widths of microfacet lobes that look most like the paper's lobe of an exponent s.

Beckmann's distribution takes α = √(2 / (s + 2)), of nearly the same shape as the lobe (Walter et
al. 2007, section 5.2). The GGX distribution has longer tails and takes a narrower lobe; its power
and its largest α were chosen for the least ꟻLIP between spheres (docs/results.md).
"""

from typing import Any

import numpy as np

_GGX_POWER, _GGX_ROUGHEST = 1.25, 0.6
"""Power that makes GGX's α of Beckmann's, and the largest α of GGX."""


def beckmann_alpha(exponent: Any) -> Any:
    """Return Beckmann's α = √(2 / (s + 2)), in (0, 1], of exponents s of any shape, at least 0.

    Example:
        >>> float(beckmann_alpha(198.0))
        0.1
    """
    return np.sqrt(2 / (exponent + 2))


def ggx_alpha(exponent: Any) -> Any:
    """Return GGX's α = min((2 / (s + 2))^(5/8), 0.6) of exponents s of any shape, at least 0.

    Roughness as glTF and most engines have it is √α.

    Example:
        >>> ggx_alpha(np.array([1.0, 62.0])).round(3).tolist()
        [0.6, 0.115]
    """
    return np.minimum(beckmann_alpha(exponent) ** _GGX_POWER, _GGX_ROUGHEST)
