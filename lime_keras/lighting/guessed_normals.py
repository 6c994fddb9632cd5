"""A rough guess of an object's normals from its mask alone: a dome with the mask's outline.

The height h over the mask's plane solves ∇²h = −4 with h = 0 at the rim, and the surface is z = √h.
For a disc this is a hemisphere, for an ellipse half an ellipsoid, and for any other outline a
cushion. The dome has no dents, creases or flat faces of the object. A light estimated with these
normals therefore shows its lamps blurred, and only roughly in their places.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve
from skimage.transform import resize

_GRID = 96
"""Longer side of the grid for the dome, in pixels: enough for a smooth dome; it takes 0.1 s."""


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
    coarse = resize(inside.astype(np.float64), shape, order=1, anti_aliasing=step > 1) >= 0.5
    height = np.pad(_film(coarse), 1)
    down, right = np.gradient(height)
    # The slope of z = √h is ∇h / 2√h. The vectors are the normals times 2√h: finite at the rim too.
    vectors = np.stack([-right, down, 2 * np.sqrt(height)], axis=-1)[1:-1, 1:-1]
    vectors = resize(vectors, (*inside.shape, 3), order=1, mode="edge")
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    # Parts too thin for the grid get a normal that faces the viewer.
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), (0.0, 0.0, 1.0))


def _film(inside: np.ndarray) -> np.ndarray:
    """Return the height `(h, w)` in pixels² that solves ∇²h = −4 inside, and is 0 outside."""
    padded = np.pad(inside, 1)
    number = np.full(padded.shape, -1)
    number[padded] = np.arange(np.sum(padded))
    here, count = number[padded], int(np.sum(padded))
    if not count:
        return np.zeros(inside.shape)
    rows, columns = [here], [here]
    values = [np.full(count, 4.0)]
    for axis, shift in ((0, 1), (0, -1), (1, 1), (1, -1)):
        other = np.roll(number, shift, axis)[padded]
        rows.append(here[other >= 0])
        columns.append(other[other >= 0])
        values.append(np.full(np.sum(other >= 0), -1.0))
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    height = np.zeros(inside.shape)
    height[inside] = spsolve(coo_array(entries, shape=(count, count)).tocsc(), np.full(count, 4.0))
    return height
