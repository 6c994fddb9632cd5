"""The material that Eq. 4 takes."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class BlinnPhong:
    """A complete Blinn–Phong material, as Eq. 4 takes it.

    Attributes:
        diffuse_albedo: m_d, `(3,)` linear RGB in [0, 1].
        specular_albedo: m_s in [0, 1], the factor of the furnace-normalised S.
        exponent: shininess s, at least 0.
        ambient: m_a, radiance; the same in all three channels.
    """

    diffuse_albedo: np.ndarray
    specular_albedo: float
    exponent: float
    ambient: float = 0.0
