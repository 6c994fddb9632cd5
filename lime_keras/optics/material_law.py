"""The law of materials: what section 5.1 of the paper draws for each scene."""

import numpy as np

from lime_keras.material import BlinnPhong
from lime_keras.optics import colour, shininess

AMBIENT = (0.0, 0.05)
"""Range of m_a, linear radiance."""


def sample_material(rng: np.random.Generator) -> BlinnPhong:
    """Draw a material.

    m_d is uniform in YUV; m_s and m_a are uniform; s is uniform over the bins and log-uniform
    inside a bin.
    """
    exponent_bin = rng.integers(shininess.BIN_COUNT)
    log = shininess.LOG_LOW + shininess.BIN_WIDTH * (exponent_bin + rng.uniform())
    return BlinnPhong(
        diffuse_albedo=sample_diffuse_albedo(rng),
        specular_albedo=float(rng.uniform()),
        exponent=float(10.0**log),
        ambient=float(rng.uniform(*AMBIENT)),
    )


def sample_diffuse_albedo(rng: np.random.Generator) -> np.ndarray:
    """Draw m_d, `(3,)` linear RGB in [0, 1], uniformly from the YUV colours that are RGB colours.

    Other YUV colours are rejected: if they were clipped, three quarters of all albedos would lie on
    the faces of the RGB cube.
    """
    while True:
        rgb = colour.yuv_to_rgb(rng.uniform(colour.YUV_LOW, colour.YUV_HIGH))
        if rgb.min() >= 0 and rgb.max() <= 1:
            return rgb
