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
    top, bottom, left, right, right_share, bottom_share = _between(direction, *radiance.shape)
    upper = radiance[top, left] * (1 - right_share) + radiance[top, right] * right_share
    lower = radiance[bottom, left] * (1 - right_share) + radiance[bottom, right] * right_share
    return upper * (1 - bottom_share) + lower * bottom_share


def splat(values: np.ndarray, direction: np.ndarray, height: int, width: int) -> np.ndarray:
    """Sums `(height, width)` of values `(N,)` in directions `(N, 3)`, each shared by four texels.

    The transpose of `lookup`: Σ splat(v) · E = Σ v · lookup(E). In double precision.
    """
    top, bottom, left, right, right_share, bottom_share = _between(direction, height, width)
    total = np.zeros(height * width)
    for row, row_share in ((top, 1 - bottom_share), (bottom, bottom_share)):
        for column, column_share in ((left, 1 - right_share), (right, right_share)):
            weights = values * row_share * column_share
            total += np.bincount(row * width + column, weights, minlength=len(total))
    return total.reshape(height, width)


def blur(radiance: np.ndarray, angle: float) -> np.ndarray:
    """A map `(H, W)` blurred by a Gaussian on the sphere; W is even. The integral stays.

    Along the parallels, then along the meridians and across the poles: round except within some
    angles of a pole.

    Args:
        radiance: any values per steradian.
        angle: standard deviation in radians.
    """
    height, width = radiance.shape
    solid_angle = solid_angles(height, width)
    energy = radiance * solid_angle
    sin_theta = np.sin(np.pi * (np.arange(height) + 0.5) / height)[:, None]
    energy = _smooth(energy, angle / (2 * np.pi * sin_theta), axis=1)
    # A meridian goes on behind the pole on the opposite one: 2 H rows make a full circle. Shares of
    # a texel's energy move to texels of other sizes, so what each could receive is blurred as well.
    both = [
        _smooth(np.concatenate([part, np.roll(part, width // 2, 1)[::-1]]), angle / 2 / np.pi, 0)
        for part in (energy, solid_angle)
    ]
    return np.maximum(both[0][:height] / both[1][:height], 0)


def _smooth(values: np.ndarray, share: np.ndarray | float, axis: int) -> np.ndarray:
    """Periodic Gaussian blur along an axis; `share`: its deviation as a share of the period."""
    count = values.shape[axis]
    frequency = np.fft.rfftfreq(count, 1 / count)
    frequency = frequency[:, None] if axis == 0 else frequency
    response = np.exp(-2 * (np.pi * frequency * share) ** 2)
    return np.fft.irfft(np.fft.rfft(values, axis=axis) * response, count, axis=axis)


def _between(direction: np.ndarray, height: int, width: int) -> tuple[np.ndarray, ...]:
    """The rows and columns of texels around directions, and the shares of the latter of each."""
    x, y, z = np.moveaxis(direction, -1, 0)
    u = np.arctan2(x, -z) / (2 * np.pi)
    v = np.arctan2(np.hypot(x, z), y) / np.pi
    column = u * width - 0.5
    row = np.clip(v * height - 0.5, 0, height - 1)
    left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    bottom = np.minimum(top + 1, height - 1)
    return top, bottom, left % width, (left + 1) % width, column - left, row - top


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
