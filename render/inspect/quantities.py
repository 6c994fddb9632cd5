"""Quantities of examples for the histograms of a corpus, measured from its records.

Angles are in degrees; left, right, up and down are meant as in the image.
"""

import math
from collections.abc import Mapping

import numpy as np

from lime_keras.optics import colour, environment

RECORDED = (
    "mask",
    "environment",
    "camera",
    "diffuse_albedo",
    "specular_albedo",
    "shininess",
    "ambient",
    "shape",
    "light",
)
"""Features that `of_record` reads; they are quick to decode."""
PICTURED = ("image", "mask", "diffuse_shading", "specular_shading", "mirror")
"""Features that `of_pictures` reads."""


def of_record(example: Mapping) -> dict[str, float]:
    """Return the quantities that are drawn at random, by name.

    Some are stored in the record; the others are measured from mask and environment.

    Args:
        example: the features `RECORDED`, in NumPy.
    """
    size = len(example["mask"])
    fx, fy, cx, cy = (float(value) for value in example["camera"])
    left, right = _extent(example["mask"].any(axis=(0, 2)))
    top, bottom = _extent(example["mask"].any(axis=(1, 2)))
    across, down = (left + right) / 2, (top + bottom) / 2
    x, y, z = _strongest(example["environment"][..., 0])
    red, green, blue = (float(value) for value in example["diffuse_albedo"])
    luma, u, v = (float(value) for value in colour.rgb_to_yuv(example["diffuse_albedo"]))
    return {
        "red": red,
        "green": green,
        "blue": blue,
        "y": luma,
        "u": u,
        "v": v,
        "specular_albedo": float(example["specular_albedo"]),
        "ambient": float(example["ambient"]),
        "log_exponent": math.log10(example["shininess"]),
        "coverage": float(example["mask"].mean()),
        "fill": max(right - left, bottom - top) / size,
        "shift_across": across / size - 0.5,
        "shift_up": 0.5 - down / size,
        "off_axis_across": math.degrees(math.atan2(across - cx, fx)),
        "off_axis_up": math.degrees(math.atan2(cy - down, fy)),
        "field_of_view": math.degrees(2 * math.atan2(size / 2, fx)),
        "azimuth": math.degrees(math.atan2(x, z)),
        "elevation": math.degrees(math.asin(y)),
        "mean_radiance": environment.spherical_mean(example["environment"][..., 0]),
    }


def of_pictures(example: Mapping) -> dict[str, float]:
    """Return the quantities of the object's brightness in its fully covered pixels, by name.

    There are none if no pixel is fully covered.

    Args:
        example: the features `PICTURED`, in NumPy.
    """
    inside = np.flatnonzero(example["mask"] >= 1)
    if not len(inside):
        return {}
    srgb = example["image"].reshape(-1, 3)[inside]
    out = {
        "level": float(srgb.mean()),
        "clipped": float((srgb >= colour.CLIPPED).any(axis=-1).mean()),
    }
    for name in PICTURED[2:]:
        values = example[name].reshape(-1)[inside]
        out |= {f"{name}_mean": float(values.mean()), f"{name}_max": float(values.max())}
    return out


def _extent(covered: np.ndarray) -> tuple[int, int]:
    """Return the first covered row or column and the last plus 1; 0 and the length if none is."""
    (where,) = np.nonzero(covered)
    return (int(where[0]), int(where[-1]) + 1) if len(where) else (0, len(covered))


def _strongest(radiance: np.ndarray) -> np.ndarray:
    """Return the unit direction `(3,)` of the texel of most energy."""
    energy = radiance * environment.solid_angles(*radiance.shape)
    return environment.directions(*radiance.shape).reshape(-1, 3)[np.argmax(energy)]
