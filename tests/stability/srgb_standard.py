"""The sRGB transfer functions of IEC 61966-2-1 in double precision, as references."""

import numpy as np


def decoded(srgb: np.ndarray) -> np.ndarray:
    """Convert sRGB values to linear radiance."""
    power = ((np.maximum(srgb, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(srgb > 0.04045, power, srgb / 12.92)


def encoded(linear: np.ndarray) -> np.ndarray:
    """Convert linear radiance to sRGB values."""
    power = 1.055 * np.maximum(linear, 0.0) ** (1 / 2.4) - 0.055
    return np.where(linear > 0.0031308, power, linear * 12.92)
