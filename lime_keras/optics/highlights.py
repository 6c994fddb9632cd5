"""The pixels whose diffuse part a highlight hides, and the diffuse part that is likely there.

Where a channel is clipped, or where the highlight is most of the light, subtracting m_s · S from
the photo does not give m_d · D: an error of S leaves a dark hole. D is smooth, so the hole is
filled from its surroundings.
"""

import math

import numpy as np

from lime_keras.optics import colour

SHARE = 0.5  # share of a pixel's radiance from which its specular part hides the diffuse one
WHITE = 254 / 255
"""sRGB level from which a channel counts as clipped; JPEG leaves it one below the highest."""
_GRID = 256  # longer side of the grid on which holes are closed, in cells; highlights are larger
_PART = 1 << 18  # pixels, about, that are summed at a time
_DRAW = 0.01  # covered share of a cell at which it counts as much as what is around it


def hidden(image_srgb: np.ndarray, specular: np.ndarray) -> np.ndarray:
    """Return where the diffuse part cannot be read, bool `(H, W)`.

    Args:
        image_srgb: photo `(H, W, 3)`, sRGB in [0, 1].
        specular: m_s · S, linear radiance `(H, W, 1)`, at least 0.
    """
    clipped = colour.brightest(image_srgb) >= WHITE
    brightness = colour.grey(colour.srgb_to_linear(image_srgb))
    return clipped | (specular[..., 0] > SHARE * brightness)


def inpainted(values: np.ndarray, known: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return values where they are wanted, filled in from the known ones around.

    Known values are averaged over ever larger cells until there are some, then brought back,
    smoothed, to the cells that lack them (pull and push).

    Args:
        values: `(H, W, C)`, finite where they are known.
        known: where the values are known, bool `(H, W)`.
        wanted: where values are wanted, bool `(H, W)`.

    Returns:
        Values `(N, C)` of the N wanted pixels, row by row; 0 if nothing is known.
    """
    step = math.ceil(max(known.shape) / _GRID)
    sums, counts = [], []
    # Some rows of cells at a time: the product of a large photo would take much memory.
    height = step * max(1, _PART // (step * known.shape[1]))
    for top in range(0, len(known), height):
        part = known[top : top + height, :, None]
        shown = np.where(part, values[top : top + height], np.float32(0))
        sums.append(_summed(shown, step))
        counts.append(_summed(part.astype(np.float32), step))
    starts = np.arange(0, known.shape[1], step)
    totals, weights = np.concatenate(sums), np.concatenate(counts)
    if step > 1:
        totals, weights = (
            np.add.reduceat(rows, starts, axis=1) / step**2 for rows in (totals, weights)
        )
    grid = _pulled(totals, weights)
    rows, columns = np.nonzero(wanted)
    return _between(grid, (rows + 0.5) / step - 0.5, (columns + 0.5) / step - 0.5)


def _pulled(totals: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the values `(h, w, C)` of all cells, of weighted sums and weights `(h, w, 1)`."""
    if max(weights.shape) == 1:
        return totals / np.maximum(weights, _DRAW)
    halves = [
        _summed(_summed(sums, 2).swapaxes(0, 1), 2).swapaxes(0, 1) for sums in (totals, weights)
    ]
    # A cell that is known in part counts as known.
    excess = np.maximum(halves[1], 1)
    coarse = _pulled(halves[0] / excess, halves[1] / excess)
    rows, columns = (np.arange(side) / 2 - 0.25 for side in weights.shape[:2])
    at = np.meshgrid(rows, columns, indexing="ij")
    around = _between(coarse, at[0].ravel(), at[1].ravel()).reshape(totals.shape)
    return (totals + _DRAW * around) / (weights + _DRAW)


def _summed(values: np.ndarray, step: int) -> np.ndarray:
    """Return the sums of each `step` rows of `(H, ...)`; the last may have fewer."""
    out = values[::step].copy()
    for first in range(1, step):
        rows = values[first::step]
        out[: len(rows)] += rows
    return out


def _between(grid: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return values `(N, C)` between the cells of a grid `(h, w, C)`, interpolated linearly."""
    rows = np.clip(rows, 0, len(grid) - 1)
    columns = np.clip(columns, 0, grid.shape[1] - 1)
    top, left = rows.astype(np.int64), columns.astype(np.int64)
    bottom, right = np.minimum(top + 1, len(grid) - 1), np.minimum(left + 1, grid.shape[1] - 1)
    down, across = (rows - top)[:, None], (columns - left)[:, None]
    above = grid[top, left] * (1 - across) + grid[top, right] * across
    below = grid[bottom, left] * (1 - across) + grid[bottom, right] * across
    return above * (1 - down) + below * down
