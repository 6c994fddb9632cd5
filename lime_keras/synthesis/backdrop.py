"""Behind the object: backgrounds cut from textures, and the surroundings out of focus.

Batches of scenes in `keras.ops`, on the device that trains. All that is random comes as the draws
of `scene_draws.draw`, each with a leading axis of B; so each background follows from its own draws.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from keras import ops

from lime_keras.arrays import spline_weights
from lime_keras.optics import colour

from . import panorama

_SHARP_ROWS, _BLURRED_ROWS = 256, 32
"""Rows of the map in which the surroundings are looked up, at the most and the least sharpness:
0.7° and 5.6° a texel, where a crop shows some 10° to 30°."""
_GRID = 64
"""Cells along each side of the grid on which the surroundings are looked up."""

_DECODED = colour.srgb_to_linear(np.arange(256) / 255).astype(np.float32)
"""Linear radiance of the 8-bit sRGB levels."""


def background(
    textures: Any, radiance: Any, rotation: Any, camera: Any, size: int, draws: Mapping[str, Any]
) -> Any:
    """Make the backgrounds of a batch, `(B, S, S, 3)` float32, linear radiance in [0, 1].

    A background is a texture, the surroundings as the light's map shows them, or two of these on
    both sides of a smooth random field. Each part has a gain and a tint of its own.

    Args:
        textures: sRGB pictures `(K, T, T, 3)` uint8.
        radiance: the lights in the map's frame, linear radiance `(B, H, 2 H)`, at least 0.
        rotation: rotations `(B, 3, 3)` from the map's frame to camera space.
        camera: fx, fy, cx, cy in pixels, `(B, 4)`.
        size: S, height and width in pixels, at most T.
        draws: the background's draws (`scene_draws.draw`).
    """
    first, second = _cropped(textures, size, draws)
    rooms = _surroundings(radiance, rotation, camera, size, draws["sharpness"])
    tint = ops.reshape(draws["tint"], (-1, 2, 1, 1, 3))
    surrounded = ops.reshape(draws["surrounded"], (-1, 1, 1, 1)) > 0
    first = ops.clip(ops.where(surrounded, rooms, first) * tint[:, 0], 0.0, 1.0)
    second = ops.clip(second * tint[:, 1], 0.0, 1.0)
    share = ops.sigmoid(_spread(draws["blend"], size))[..., None]
    return first + share * (second - first)


def _cropped(textures: Any, size: int, draws: Mapping[str, Any]) -> tuple[Any, Any]:
    """Return the two turned crops of each scene, linear radiance `(B, S, S, 3)` each."""
    side = textures.shape[1]
    turn = draws["texture_turn"][..., None, None]
    row, column = _turned_indices(turn, size)
    corner = draws["corner"][..., None, None]
    index = draws["texture"][..., None, None] * side + corner[:, :, 0] + row
    index = index * side + corner[:, :, 1] + column
    levels = ops.take(ops.reshape(textures, (-1, 3)), index, axis=0)
    decoded = ops.take(_DECODED, ops.cast(levels, "int32"))
    return decoded[:, 0], decoded[:, 1]


def _turned_indices(turn: Any, size: int) -> tuple[Any, Any]:
    """Return the row and the column, `(..., S, S)`, that turned pictures take each pixel from.

    Args:
        turn: 0 … 7, `(..., 1, 1)` int32: bit 0 exchanges left and right, bit 1 top and bottom,
            bit 2 rows and columns.
        size: S, height and width of the pictures.
    """
    along = np.arange(size, dtype=np.int32)
    row, column = along[:, None], along[None, :]
    column = ops.where(turn % 2 == 1, size - 1 - column, column)
    row = ops.where(turn // 2 % 2 == 1, size - 1 - row, row)
    return ops.where(turn >= 4, column, row), ops.where(turn >= 4, row, column)


def _surroundings(radiance: Any, rotation: Any, camera: Any, size: int, sharpness: Any) -> Any:
    """Return what the camera's rays see of the lights, out of focus, `(B, S, S, 1)`.

    The rays are those through a coarse grid, between which the radiance is interpolated.
    """
    across = _pixels_of_nodes(_GRID + 3, size)
    fx, fy, cx, cy = (camera[:, k, None, None] for k in range(4))
    ray = (across[None, None, :] - cx) / fx, (cy - across[None, :, None]) / fy, -1.0
    # The rotation's transpose takes camera space to the map's frame.
    x, y, z = (sum(rotation[:, i, j, None, None] * ray[i] for i in range(3)) for j in range(3))
    at = panorama.place(x, y, z)
    finer = panorama.reduced(radiance, _SHARP_ROWS)
    coarser = panorama.reduced(finer, _BLURRED_ROWS)
    sharp, blurred = panorama.looked_up(finer, *at), panorama.looked_up(coarser, *at)
    seen = blurred + ops.reshape(sharpness, (-1, 1, 1)) * (sharp - blurred)
    return _spread(seen, size)[..., None]


def _spread(lattice: Any, size: int) -> Any:
    """Interpolate lattices `(B, n, n)` over images `(B, S, S)` by uniform cubic B-splines."""
    weights = spline_weights(lattice.shape[1], size)
    return ops.matmul(ops.matmul(weights, lattice), weights.T)


def _pixels_of_nodes(count: int, size: int) -> np.ndarray:
    """Return the coordinates in pixels of the nodes of `_spread`, `(count,)` float32.

    The first and the last pixel, whose centres are ½ and S − ½, lie on the nodes next to the ends.
    """
    spacing = (size - 1) / (count - 3)
    return (0.5 + (np.arange(count) - 1) * spacing).astype(np.float32)


def compose(radiance: Any, coverage: Any, behind: Any) -> Any:
    """Return the linear radiance of whole images, `(B, S, S, 3)`: objects before backgrounds.

    Args:
        radiance: linear radiance of the objects, Eq. 4, `(B, S, S, 3)`, at least 0 and finite.
        coverage: share of each pixel that the object covers, `(B, S, S, 1)` in [0, 1].
        behind: the backgrounds, linear radiance `(B, S, S, 3)`.
    """
    return coverage * radiance + (1.0 - coverage) * behind
