"""Normals where nobody knows them: a soap film's dome over the mask. Rough, and only that.

The height h over the mask's plane solves ∇²h = −4 with h = 0 at the rim, and the surface is z = √h.
For a disc this is a hemisphere, for an ellipse half an ellipsoid; any other object becomes the
cushion that its outline suggests. Dents, creases and flat faces are not known to it, so a light
estimated with these normals has its lamps about where they are, blurred, and no more.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve
from skimage.transform import resize

_GRID = 96
"""Longer side of the grid that the dome is solved on: it is smooth, and this takes 0.1 s."""


def normals(mask: np.ndarray) -> np.ndarray:
    """Unit normals `(H, W, 3)` in camera space of a dome over a mask, 0 outside.

    Args:
        mask: `(H, W, 1)` in [0, 1]; what is at least a half is the object.

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
    """Normals over the mask's bounding box `(h, w, 3)`."""
    step = max(1.0, max(inside.shape) / _GRID)
    shape = [max(1, round(side / step)) for side in inside.shape]
    coarse = resize(inside.astype(np.float64), shape, order=1, anti_aliasing=step > 1) >= 0.5
    height = np.pad(_film(coarse), 1)
    down, right = np.gradient(height)
    # z = √h slopes by ∇h / 2√h: this is its normal times 2√h, finite at the rim too.
    vectors = np.stack([-right, down, 2 * np.sqrt(height)], axis=-1)[1:-1, 1:-1]
    vectors = resize(vectors, (*inside.shape, 3), order=1, mode="edge")
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    # Slivers that the grid lost face the viewer.
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), (0.0, 0.0, 1.0))


def _film(inside: np.ndarray) -> np.ndarray:
    """The solution h `(h, w)` of ∇²h = −4 inside, 0 outside, in pixels²."""
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
