"""A rough guess of an object's normals from its mask alone: a dome with the mask's outline.

The height h over the mask's plane solves ∇²h = −4 with h = 0 at the rim, and the surface is z = √h.
For a disc this is a hemisphere, for an ellipse half an ellipsoid, and for any other outline a
cushion. The dome has no dents, creases or flat faces of the object. A light estimated with these
normals therefore shows its lamps blurred, and only roughly in their places.
"""

import numpy as np

_GRID = 96
"""Longer side of the grid for the dome, in pixels: enough for a smooth dome; it takes 0.02 s."""
_HALF = 0.5 - 1e-9
"""Least covered share of an inner cell of the grid: one half, whatever the sums were rounded to."""
_RESIDUAL = 1e-5
"""Length of the residual, over that of the right-hand side, at which the film counts as solved."""


def normals(mask: np.ndarray) -> np.ndarray:
    """Return the unit normals `(H, W, 3)` in camera space of a dome over a mask, 0 outside.

    Args:
        mask: coverage `(H, W, 1)` in [0, 1]; pixels of at least one half are the object.

    Raises:
        ValueError: if the mask has another shape.
    """
    if mask.ndim != 3 or mask.shape[-1] != 1:
        raise ValueError(f"a mask has shape (H, W, 1), got {mask.shape}")
    inside = mask[..., 0] >= 0.5
    out = np.zeros((*inside.shape, 3), np.float32)
    if not inside.any():
        return out
    rows, columns = (np.flatnonzero(inside.any(axis=axis)) for axis in (1, 0))
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    out[box] = _dome(inside[box])
    return out * inside[..., None]


def _dome(inside: np.ndarray) -> np.ndarray:
    """Return the dome's normals `(h, w, 3)` over the mask's bounding box `(h, w)`."""
    step = max(1.0, max(inside.shape) / _GRID)
    shape = [max(1, round(side / step)) for side in inside.shape]
    coarse = _averaged(_averaged(inside.astype(np.float64), shape[0]).T, shape[1]).T >= _HALF
    height = np.pad(_film(coarse), 1)
    down, right = np.gradient(height)
    # The slope of z = √h is ∇h / 2√h. The vectors are the normals times 2√h: finite at the rim too.
    vectors = np.stack([-right, down, 2 * np.sqrt(np.maximum(height, 0))], axis=-1)[1:-1, 1:-1]
    vectors = _between(vectors, inside.shape[0]).swapaxes(0, 1)
    vectors = _between(vectors, inside.shape[1]).swapaxes(0, 1)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    # Parts too thin for the grid get a normal that faces the viewer.
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), (0.0, 0.0, 1.0))


def _averaged(values: np.ndarray, count: int) -> np.ndarray:
    """Return means `(count, ...)` over equal parts of the first axis of values `(N, ...)`."""
    sums = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    edges = np.arange(count + 1) * (len(values) / count)
    return np.diff(_at(sums, edges), axis=0) * (count / len(values))


def _between(values: np.ndarray, count: int) -> np.ndarray:
    """Return values `(N, ...)` interpolated linearly to `(count, ...)`, repeated at the ends."""
    position = (np.arange(count) + 0.5) * (len(values) / count) - 0.5
    return _at(values, np.clip(position, 0, len(values) - 1))


def _at(values: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Return values `(N, ...)` at positions `(M,)` from 0 to N − 1, interpolated linearly."""
    low = np.minimum(position.astype(np.int64), len(values) - 1)
    high = np.minimum(low + 1, len(values) - 1)
    share = (position - low).reshape(-1, *[1] * (values.ndim - 1))
    return values[low] * (1 - share) + values[high] * share


def _film(inside: np.ndarray) -> np.ndarray:
    """Return the height `(h, w)` in pixels² that solves ∇²h = −4 inside, and is 0 outside.

    Conjugate gradients need no matrix, and fewer steps than the grid has rows and columns together.
    """
    padded = np.pad(inside, 1).astype(np.float64)
    height, residual = np.zeros_like(padded), 4.0 * padded
    direction, applied = residual.copy(), np.zeros_like(padded)
    square = float(np.vdot(residual, residual))
    enough = _RESIDUAL**2 * square
    while square > enough:
        np.multiply(direction, 4, out=applied)
        core = applied[1:-1, 1:-1]
        core -= direction[:-2, 1:-1]
        core -= direction[2:, 1:-1]
        core -= direction[1:-1, :-2]
        core -= direction[1:-1, 2:]
        applied *= padded
        step = square / float(np.vdot(direction, applied))
        height += step * direction
        residual -= step * applied
        square, before = float(np.vdot(residual, residual)), square
        direction *= square / before
        direction += residual
    return height[1:-1, 1:-1]
