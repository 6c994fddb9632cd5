"""Equirectangular environment maps in Mitsuba's convention.

direction(u, v) = (sin πv · sin 2πu, cos πv, −sin πv · cos 2πu), v = 0 at the top row. A map is
`(H, W)` linear radiance. It has one channel, because the paper's light is white-balanced.
"""

import functools
import math

import numpy as np

MEAN_RADIANCE = 0.4
"""Spherical mean to which every light is scaled: the exposure (docs/explanation/decisions.md)."""
CAMERA_PITCH = (math.radians(-10), math.radians(30))
"""Range in radians of the angle by which the camera looks down, and so of the light's tilt."""
STORED_SHAPE = (64, 128)  # rows and columns of the environment map that a record stores
_BLOCK = 2**14
"""Number of directions that are looked up at once: few enough for the processor's cache."""


def directions(height: int, width: int) -> np.ndarray:
    """Return the unit directions `(height, width, 3)` through the texel centres."""
    theta = np.pi * (np.arange(height) + 0.5) / height
    phi = 2 * np.pi * (np.arange(width) + 0.5) / width
    sin_theta = np.sin(theta)[:, None]
    up = np.broadcast_to(np.cos(theta)[:, None], (height, width))
    return np.stack([sin_theta * np.sin(phi), up, -sin_theta * np.cos(phi)], axis=-1)


def solid_angles(height: int, width: int) -> np.ndarray:
    """Return each texel's exact solid angle in steradians, `(height, width)`; the sum is 4π."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    rows = (edges[:-1] - edges[1:]) * (2 * np.pi / width)
    return np.broadcast_to(rows[:, None], (height, width))


def spherical_mean(radiance: np.ndarray) -> float:
    """Return the mean radiance of a map `(H, W)` over the sphere.

    Example:
        >>> round(spherical_mean(np.ones((64, 128))), 6)
        1.0
    """
    return float(np.sum(radiance * solid_angles(*radiance.shape), dtype=np.float64) / (4 * np.pi))


def check(radiance: np.ndarray) -> None:
    """Raise ValueError if a map `(H, W)` holds values that are no radiance.

    A single such texel would spoil the shading of every surface that it lights.

    Raises:
        ValueError: if a texel is NaN, infinite or negative.
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
    """Return the radiance `(...)` of a map `(H, W)` in directions `(..., 3)`, bilinear.

    Longitude wraps; at the poles the row is clamped. Directions need not have length 1.
    """
    towards = direction.reshape(-1, 3)
    out = np.empty(len(towards), np.result_type(radiance, direction))
    for first in range(0, len(towards), _BLOCK):
        some = slice(first, first + _BLOCK)
        out[some] = _lookup(radiance, towards[some])
    return out.reshape(direction.shape[:-1])


def _lookup(radiance: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the radiance `(N,)` of a map in directions `(N, 3)`; see `lookup`."""
    width = radiance.shape[1]
    top, bottom, left, right, right_share, bottom_share = _between(direction, *radiance.shape)
    left_share = 1 - right_share
    texels = radiance.reshape(-1)  # `take` with one index needs a third of the time of two indices
    rows = [
        texels.take(row + left) * left_share + texels.take(row + right) * right_share
        for row in (top * width, bottom * width)
    ]
    return rows[0] * (1 - bottom_share) + rows[1] * bottom_share


def splat(values: np.ndarray, direction: np.ndarray, height: int, width: int) -> np.ndarray:
    """Return a map `(height, width)` that sums values `(N,)` given in directions `(N, 3)`.

    Each value is divided among the four nearest texels. This is the transpose of `lookup`:
    Σ splat(v) · E = Σ v · lookup(E). The sums are in double precision.
    """
    top, bottom, left, right, right_share, bottom_share = _between(direction, height, width)
    total = np.zeros(height * width)
    for row, row_share in ((top, 1 - bottom_share), (bottom, bottom_share)):
        for column, column_share in ((left, 1 - right_share), (right, right_share)):
            weights = values * row_share * column_share
            total += np.bincount(row * width + column, weights, minlength=len(total))
    return total.reshape(height, width)


def blur(radiance: np.ndarray, angle: float) -> np.ndarray:
    """Return a map `(H, W)` blurred by a Gaussian on the sphere.

    The map is blurred along the parallels, then along the meridians and across the poles. The
    kernel is round and keeps the map's integral, except within a few `angle` of a pole.

    Args:
        radiance: map `(H, W)` of values per steradian, at least 0; W is even.
        angle: standard deviation in radians.
    """
    height, width = radiance.shape
    solid_angle = solid_angles(height, width)
    energy = radiance * solid_angle
    sin_theta = np.sin(np.pi * (np.arange(height) + 0.5) / height)[:, None]
    energy = _smooth(energy, angle / (2 * np.pi * sin_theta), axis=1)
    # Behind the pole a meridian continues as the opposite meridian: 2 H rows make a full circle.
    # Energy moves between texels of different sizes, so the solid angles are blurred as well.
    both = [
        _smooth(np.concatenate([part, np.roll(part, width // 2, 1)[::-1]]), angle / 2 / np.pi, 0)
        for part in (energy, solid_angle)
    ]
    return np.maximum(both[0][:height] / both[1][:height], 0)


def _smooth(values: np.ndarray, share: np.ndarray | float, axis: int) -> np.ndarray:
    """Blur periodic values along an axis by a Gaussian of standard deviation `share` × period."""
    count = values.shape[axis]
    frequency = np.fft.rfftfreq(count, 1 / count)
    frequency = frequency[:, None] if axis == 0 else frequency
    response = np.exp(-2 * (np.pi * frequency * share) ** 2)
    return np.fft.irfft(np.fft.rfft(values, axis=axis) * response, count, axis=axis)


def _between(direction: np.ndarray, height: int, width: int) -> tuple[np.ndarray, ...]:
    """Return the two rows and the two columns of texels around each direction, and two shares.

    The shares are the weights in [0, 1] of the right column and of the bottom row.
    """
    x, y, z = np.ascontiguousarray(np.moveaxis(direction, -1, 0))
    u = np.arctan2(x, -z) / (2 * np.pi)
    # This equals `hypot` for lengths of 1e-150 … 1e150, in a third of its time.
    across = np.sqrt(np.square(x, dtype=np.float64) + np.square(z, dtype=np.float64))
    v = np.arctan2(across.astype(x.dtype, copy=False), y) / np.pi
    column = u * width - 0.5
    row = np.clip(v * height - 0.5, 0, height - 1)
    left, top = np.floor(column), np.floor(row)
    right_share, bottom_share = column - left, row - top
    # u lies in [-1/2, 1/2], so a column is less than one turn away.
    left, top = left.astype(np.int64), top.astype(np.int64)
    left += width * (left < 0)
    right = left + 1
    right -= width * (right == width)
    return top, np.minimum(top + 1, height - 1), left, right, right_share, bottom_share


def rotate(radiance: np.ndarray, rotation: np.ndarray, height: int, width: int) -> np.ndarray:
    """Resample a map into a rotated frame, with a box filter.

    Each texel of the result is the mean of at least as many look-ups as it covers texels of the
    source, so no lamp is missed between two look-ups.

    Args:
        radiance: linear radiance `(H, W)` in the source frame, at least 0.
        rotation: `(3, 3)` rotation that takes source directions to the new frame.
        height: rows of the result.
        width: columns of the result.

    Returns:
        Linear radiance `(height, width)` in the new frame.

    Raises:
        ValueError: if a texel is NaN, infinite or negative.
    """
    check(radiance)
    supersampling = max(4, -(-len(radiance) // height))
    precision = np.result_type(radiance, np.float32).char
    fine, weights, total_weights = _box_filter(height, width, supersampling, precision)
    total = np.empty((height, width))
    step = max(1, _BLOCK // (width * supersampling**2))
    for first in range(0, height, step):
        some = slice(first, first + step)
        values = lookup(radiance, fine[some].reshape(-1, 3) @ rotation.astype(fine.dtype))
        total[some] = np.sum(values.reshape(weights[some].shape) * weights[some], axis=(1, 3))
    return total / total_weights


@functools.lru_cache(2)
def _box_filter(
    height: int, width: int, supersampling: int, precision: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the look-ups of the texels of a map `(H, W)`, `s` × `s` in each: `(H, s, W, s, 3)`.

    Also their solid angles `(H, s, W, s)`, and the sums `(H, W)` of these.
    """
    shape = (height, supersampling, width, supersampling)
    rows, columns = height * supersampling, width * supersampling
    weights = solid_angles(rows, columns).reshape(shape)
    towards = directions(rows, columns).reshape(*shape, 3)
    total = np.sum(weights, axis=(1, 3))
    return towards.astype(precision), weights.astype(precision), total
