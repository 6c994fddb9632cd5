"""sRGB as IEC 61966-2-1 prints it, in double precision: what the library's is held against."""

import numpy as np


def decoded(srgb: np.ndarray) -> np.ndarray:
    """Linear radiance."""
    power = ((np.maximum(srgb, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(srgb > 0.04045, power, srgb / 12.92)


def encoded(linear: np.ndarray) -> np.ndarray:
    """SRGB."""
    power = 1.055 * np.maximum(linear, 0.0) ** (1 / 2.4) - 0.055
    return np.where(linear > 0.0031308, power, linear * 12.92)
