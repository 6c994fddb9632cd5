"""Equirectangular environment maps in Mitsuba's convention.

direction(u, v) = (sin πv · sin 2πu, cos πv, −sin πv · cos 2πu), v = 0 at the top row. Maps are
`(H, W)` linear radiance, one channel, because the paper's light is white-balanced.
"""

import numpy as np

STORED_SHAPE = (64, 128)
"""Rows and columns in which a record keeps the light of its scene."""


def directions(height: int, width: int) -> np.ndarray:
    """Unit directions `(height, width, 3)` through the texel centres."""
    theta = np.pi * (np.arange(height) + 0.5) / height
    phi = 2 * np.pi * (np.arange(width) + 0.5) / width
    sin_theta = np.sin(theta)[:, None]
    up = np.broadcast_to(np.cos(theta)[:, None], (height, width))
    return np.stack([sin_theta * np.sin(phi), up, -sin_theta * np.cos(phi)], axis=-1)


def solid_angles(height: int, width: int) -> np.ndarray:
    """Exact solid angle of each texel in steradian, `(height, width)`; they sum to 4π."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    rows = (edges[:-1] - edges[1:]) * (2 * np.pi / width)
    return np.broadcast_to(rows[:, None], (height, width))


def spherical_mean(radiance: np.ndarray) -> float:
    """Mean radiance over the sphere of a map `(H, W)`."""
    return float(np.sum(radiance * solid_angles(*radiance.shape), dtype=np.float64) / (4 * np.pi))


def check(radiance: np.ndarray) -> None:
    """Refuse a map that no light can have: one such texel would darken or blind what it lights.

    Raises:
        ValueError: if a texel of `(H, W)` is NaN, infinite or negative.
    """
    if radiance.size and not (np.min(radiance) >= 0 and np.max(radiance) < np.inf):
        wrong = ~((radiance >= 0) & (radiance < np.inf))
        row, column = np.argwhere(wrong)[0]
        raise ValueError(
            f"radiance is finite and at least 0, but {np.sum(wrong)} of the map's {radiance.size} "
            f"texels are not, the first {radiance[row, column]} in row {row}, column {column}: "
            "repair them, as 0 or the brightest sound texel"
        )


def lookup(radiance: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Radiance `(...)` that a map `(H, W)` holds in unit directions `(..., 3)`, bilinear.

    Longitude wraps; at the poles the row is clamped. Directions need not be exactly unit length.
    """
    height, width = radiance.shape
    x, y, z = np.moveaxis(direction, -1, 0)
    u = np.arctan2(x, -z) / (2 * np.pi)
    v = np.arctan2(np.hypot(x, z), y) / np.pi
    column = u * width - 0.5
    row = np.clip(v * height - 0.5, 0, height - 1)
    left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    right_share, bottom_share = column - left, row - top
    bottom = np.minimum(top + 1, height - 1)
    left, right = left % width, (left + 1) % width
    upper = radiance[top, left] * (1 - right_share) + radiance[top, right] * right_share
    lower = radiance[bottom, left] * (1 - right_share) + radiance[bottom, right] * right_share
    return upper * (1 - bottom_share) + lower * bottom_share


def rotate(radiance: np.ndarray, rotation: np.ndarray, height: int, width: int) -> np.ndarray:
    """Resample a map into a rotated frame, box-filtered.

    Each texel is the mean of at least as many look-ups as it holds texels of the source, so that no
    lamp falls between two.

    Args:
        radiance: `(H, W)` map in the source frame.
        rotation: `(3, 3)` taking source directions to the new frame's.
        height: rows of the result.
        width: columns of the result.

    Returns:
        `(height, width)` map in the new frame.

    Raises:
        ValueError: if a texel is NaN, infinite or negative.
    """
    check(radiance)
    supersampling = max(4, -(-len(radiance) // height))
    fine = directions(height * supersampling, width * supersampling) @ rotation
    values = lookup(radiance, fine)
    weights = solid_angles(height * supersampling, width * supersampling)
    shape = (height, supersampling, width, supersampling)
    total = np.sum((values * weights).reshape(shape), axis=(1, 3))
    return total / np.sum(weights.reshape(shape), axis=(1, 3))
