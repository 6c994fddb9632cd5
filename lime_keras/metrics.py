"""The measures of Table 1, and of the layers: functions for each example's error.

They return one number per example, `(B,)`, of NumPy arrays; those that training's validation uses
take Keras tensors, too. Shapes are not checked: a shape that does not fit raises an error of NumPy
or of the backend.
"""

from typing import Any

import numpy as np

from lime_keras.optics.namespace import namespace

_BLACK = 1e-12
"""Sum of linear radiance up to which a layer is black: far below one step of a half float."""


def overlap(mask: Any, predicted: Any) -> tuple[Any, Any]:
    """Return the numbers of pixels in the intersection and in the union of two masks, each `(B,)`.

    A pixel belongs to a mask if its coverage is at least one half.

    Args:
        mask: true coverage `(B, H, W, 1)` in [0, 1], a NumPy array or a Keras tensor.
        predicted: predicted coverage `(B, H, W, 1)` in [0, 1], of the same kind.
    """
    xp = namespace(mask, predicted)
    true, inside = mask >= 0.5, predicted >= 0.5
    both = xp.where(xp.logical_and(true, inside), 1.0, 0.0)
    either = xp.where(xp.logical_or(true, inside), 1.0, 0.0)
    return xp.sum(both, axis=(1, 2, 3)), xp.sum(either, axis=(1, 2, 3))


def overlap_ratio(intersection: Any, union: Any) -> Any:
    """Return the intersection over union (IoU) in [0, 1] of pixel counts of any shape.

    Two empty masks agree: their IoU is 1.

    Example:
        >>> overlap_ratio(np.array([1.0, 0.0]), np.array([4.0, 0.0])).tolist()
        [0.25, 1.0]
    """
    xp = namespace(intersection, union)
    return xp.where(union > 0, intersection / xp.maximum(union, 1e-9), 1.0)


def masked_relative_error(shading: Any, predicted: Any, mask: Any) -> tuple[Any, Any]:
    """Return Σ|predicted − shading| / Σ shading over the pixels of each mask, and where it exists.

    There is no error relative to nothing: an example whose mask is empty, or whose shading is black
    inside it, does not count in a mean (`mean_where_lit`).

    Args:
        shading: true linear radiance `(B, H, W, 1)`, at least 0, a NumPy array or a Keras tensor.
        predicted: predicted linear radiance `(B, H, W, 1)`, of the same kind.
        mask: coverage `(B, H, W, 1)` in [0, 1]; pixels of at least one half count.

    Returns:
        The error `(B,)`, at least 0, and 0 where it does not exist; and 1 where it exists, else 0,
        `(B,)`.

    Example:
        >>> layer, full = np.full((1, 2, 2, 1), 4.0), np.ones((1, 2, 2, 1))
        >>> error, lit = masked_relative_error(layer, 0 * layer, full)
        >>> error.tolist(), lit.tolist()
        ([1.0], [1.0])
        >>> error, lit = masked_relative_error(0 * layer, layer, full)
        >>> error.tolist(), lit.tolist()
        ([0.0], [0.0])
    """
    xp = namespace(shading, predicted, mask)
    inside = xp.where(mask >= 0.5, 1.0, 0.0)
    wrong = xp.sum(xp.abs(predicted - shading) * inside, axis=(1, 2, 3))
    size = xp.sum(shading * inside, axis=(1, 2, 3))
    lit = xp.where(size > _BLACK, 1.0, 0.0)
    return xp.where(lit > 0, wrong / xp.maximum(size, _BLACK), 0.0), lit


def mean_where_lit(error: Any, lit: Any) -> Any:
    """Return the mean relative error of the examples that have one, from means over all examples.

    Args:
        error: mean of the errors of `masked_relative_error`, of any shape.
        lit: share of the examples that have one, of the same shape.

    Returns:
        error / lit, of the same shape; 0 where no example has an error.

    Example:
        >>> mean_where_lit(np.array([0.25, 0.0]), np.array([0.5, 0.0])).tolist()
        [0.5, 0.0]
    """
    return np.where(np.greater(lit, 0), error / np.where(np.greater(lit, 0), lit, 1.0), 0.0)
