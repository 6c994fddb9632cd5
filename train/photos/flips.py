"""Flips: scenes with left and right exchanged, and their ground truth with them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .kept import INPUT_MASK, PREDICTED

_IMAGES = (
    "image", "clipped", "painted", "mask", INPUT_MASK,
    "diffuse_shading", "specular_shading", "mirror",
    "environment",  # longitude runs from −z through +x: its columns change the sign of x
)  # fmt: skip
_CAST = np.array([1, 1, -1, 1], np.float32)


def flip(batch: Mapping[str, Any], is_flipped: np.ndarray) -> dict[str, Any]:
    """Turn x into −x in camera space in some examples of a batch.

    The mirrored shape under the mirrored light gives the mirrored image, because a lobe depends on
    angles alone. So Eqs. 2 to 5 still hold, with the same material.

    Args:
        batch: features by name, with the examples along the first axis.
        is_flipped: `(B,)`, true for the examples to flip.

    Returns:
        The batch with the columns of their pictures and lights reversed, and with the slope of
        their white balance to the right negated (`camera_law.cast`).
    """
    out = dict(batch)
    for name, value in batch.items():
        if name.removeprefix(PREDICTED) in _IMAGES:
            out[name] = np.where(is_flipped[:, None, None, None], value[:, :, ::-1], value)
        elif name == "cast":
            out[name] = np.where(is_flipped[:, None], value * _CAST, value)
    return out
