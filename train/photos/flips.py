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


def flip(batch: Mapping[str, Any], is_flipped: np.ndarray) -> None:
    """Turn x into −x in camera space in some examples of a batch, in place.

    The mirrored shape under the mirrored light gives the mirrored image, because a lobe depends on
    angles alone. So Eqs. 2 to 5 still hold, with the same material. The columns of the pictures and
    lights are reversed, and the slope of the white balance to the right negated
    (`camera_law.cast`).

    Args:
        batch: features by name, arrays with the examples along the first axis.
        is_flipped: `(B,)`, true for the examples to flip.

    Raises:
        ValueError: if it is not known how an image flips.
    """
    for name, value in batch.items():
        if name.removeprefix(PREDICTED) in _IMAGES:
            value[is_flipped] = value[is_flipped][:, :, ::-1]
        elif name == "cast":
            value[is_flipped] *= _CAST
        elif value.ndim > 2:
            raise ValueError(f"{name} may have a left and a right: say in {__name__} how it flips")
