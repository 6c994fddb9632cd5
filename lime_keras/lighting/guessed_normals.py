"""A rough guess of an object's normals from its mask alone: a dome with the mask's outline.

The height h over the mask's plane solves ∇²h = −4 with h = 0 at the rim, and the surface is z = √h.
For a disc this is a hemisphere, for an ellipse half an ellipsoid, and for any other outline a
cushion. The dome has no dents, creases or flat faces of the object. A light estimated with these
normals therefore shows its lamps blurred, and only roughly in their places.
"""

import numpy as np

_GRID = 96
"""Longer side of the grid for the dome, in pixels: enough for a smooth dome; it takes 0.02 s."""
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
    rows, columns = (_areas(*sides) for sides in zip(inside.shape, shape, strict=True))
    coarse = rows @ inside.astype(np.float64) @ columns.T >= 0.5
    height = np.pad(_film(coarse), 1)
    down, right = np.gradient(height)
    # The slope of z = √h is ∇h / 2√h. The vectors are the normals times 2√h: finite at the rim too.
    rows, columns = (_tents(*sides) for sides in zip(shape, inside.shape, strict=True))
    vectors = np.stack(
        [
            rows @ part[1:-1, 1:-1] @ columns.T
            for part in (-right, down, 2 * np.sqrt(np.maximum(height, 0)))
        ],
        axis=-1,
    )
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    # Parts too thin for the grid get a normal that faces the viewer.
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), (0.0, 0.0, 1.0))


def _areas(count: int, fewer: int) -> np.ndarray:
    """Return the weights `(fewer, count)` that average samples over equal parts of their side."""
    edges = np.arange(fewer + 1)[:, None] * (count / fewer)
    sample = np.arange(count)
    overlap = np.minimum(edges[1:], sample + 1) - np.maximum(edges[:-1], sample)
    return np.maximum(overlap, 0) * (fewer / count)


def _tents(count: int, more: int) -> np.ndarray:
    """Return the weights `(more, count)` that interpolate linearly between samples of a side."""
    position = (np.arange(more)[:, None] + 0.5) * count / more - 0.5
    tent = np.maximum(1 - np.abs(np.arange(count) - position), 0)
    return tent / tent.sum(axis=1, keepdims=True)


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
