"""The guided filter, which moves the edges of a mask to those of its picture.

In a window of some pixels the mask of an object is nearly linear in the picture's colours: exactly
so for an object of one colour before a background of another. The filter fits that linear function
in the window around each pixel, and answers with the mean of all fits that hold there (He, Sun and
Tang, "Guided Image Filtering", 2013). So it corrects a mask that is a few pixels off at an edge, or
holds a patch of the background's colour. It has no weights.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from keras import layers, ops

_REACH = 6 / 128  # pixels from the middle of a window to its edge, as a share of the picture's side
_NOISE = 0.01  # contrast of a window's colours, sRGB, below which they do not shape the mask
_CONTRAST = 2.0
"""Factor by which the filtered mask is stretched about one half: means of fits have soft edges."""


class GuidedFilter(layers.Layer):
    """A layer that filters masks `(B, H, W, 1)` by pictures `(B, H, W, 3)`, sRGB in [0, 1].

    Training sees the masks as they are, because clipped pixels would have no gradient.
    """

    def call(self, inputs: list[Any], training: bool | None = None) -> Any:
        """Return the filtered mask, stretched about one half and not yet clipped to [0, 1]."""
        mask, image = inputs
        return mask if training else _CONTRAST * (filtered(mask, image) - 0.5) + 0.5


def filtered(mask: Any, image: Any) -> Any:
    """Return masks filtered by their pictures, `(B, H, W, 1)`, which may lie outside [0, 1].

    Args:
        mask: coverage `(B, H, W, 1)`; it is clipped to [0, 1].
        image: sRGB in [0, 1], `(B, H, W, 3)`.
    """
    # Planes `(B, C, H, W)`, whose means over windows are products with two matrices.
    colours, mask = (ops.moveaxis(one, 3, 1) for one in (image, ops.clip(mask, 0.0, 1.0)))
    red, green, blue = (colours[:, k : k + 1] for k in range(3))
    squares = [red * red, red * green, red * blue, green * green, green * blue, blue * blue]
    windows = _means(ops.concatenate([colours, mask, *squares, colours * mask], axis=1))
    r, g, b, m, rr, rg, rb, gg, gb, bb, rm, gm, bm = (windows[:, k : k + 1] for k in range(13))
    noise = _NOISE**2
    slopes = _solved(
        (rr - r * r + noise, rg - r * g, rb - r * b),
        (gg - g * g + noise, gb - g * b),
        bb - b * b + noise,
        (rm - r * m, gm - g * m, bm - b * m),
    )
    offset = m - slopes[0] * r - slopes[1] * g - slopes[2] * b
    fits = _means(ops.concatenate([*slopes, offset], axis=1))
    out = ops.sum(fits[:, :3] * colours, axis=1, keepdims=True) + fits[:, 3:]
    return ops.moveaxis(out, 1, 3)


def _solved(
    first: Sequence[Any], second: Sequence[Any], third: Any, right: Sequence[Any]
) -> tuple[Any, Any, Any]:
    """Return x, y and z of A (x, y, z) = `right`, by elimination without pivots.

    A is symmetric, and given by its rows from the diagonal on. Its eigenvalues are at least
    `_NOISE`², so pivots are at least that, too.
    """
    (a, b, c), (d, e), (u, v, w) = first, second, right
    over_second, over_third = b / a, c / a
    d, e, third = d - over_second * b, e - over_second * c, third - over_third * c
    v, w = v - over_second * u, w - over_third * u
    over = e / d
    z = (w - over * v) / (third - over * e)
    y = v / d - over * z
    return u / a - over_second * y - over_third * z, y, z


def _means(planes: Any) -> Any:
    """Return the means over the windows around each pixel of `(B, C, H, W)`, the same shape."""
    height, width = planes.shape[2:]
    return ops.matmul(ops.matmul(_windows(height), planes), _windows(width).T)


def _windows(size: int) -> np.ndarray:
    """Return the weights of `size` pixels in the windows around each, `(size, size)` float32."""
    along = np.arange(size)
    inside = np.abs(along[:, None] - along) <= max(1, round(_REACH * size))
    return (inside / inside.sum(axis=1, keepdims=True)).astype(np.float32)
