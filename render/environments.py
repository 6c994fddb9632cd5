"""Environment maps: read from files, and brought to sizes without losing light.

A map is `(H, W)` float32 radiance of one channel, W about 2 H, equirectangular: rows are equal
steps of the polar angle from the zenith, columns equal steps of the azimuth. Whenever a map
changes its size, every new texel is the mean of what it covers, weighted by solid angle; so the
integral over the sphere stays, wherever the light is.
"""

import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lime_keras import colour

EXTENSIONS = (".hdr", ".exr")

ASPECT = 0.02  # by which share W may differ from 2 H


def load(path: str | Path) -> np.ndarray:
    """Reads an environment map as radiance of one channel.

    Infinite texels, lights too bright for the file's half floats, become the largest finite value
    of the file; texels that are not a number or negative become 0. A warning counts both.

    Args:
        path: An OpenEXR or Radiance file with 1, 3 or 4 channels, linear Rec. 709, about 2:1.

    Returns:
        `(H, W)` float32, finite, non-negative: the luminance of the first three channels, in the
        file's unit and size.

    Raises:
        ValueError: If the file is missing, cannot be read, has another shape or number of channels,
            or is black everywhere.
    """
    image = oiio.ImageBuf(str(path))
    texels = None if image.has_error else image.get_pixels(oiio.FLOAT)
    if texels is None or image.has_error:
        raise ValueError(
            f"{path}: cannot be read as an image ({image.geterror()}); check the path, or save it "
            f"again as OpenEXR or Radiance HDR."
        )
    height, width, channels = texels.shape
    if channels not in (1, 3, 4):
        raise ValueError(
            f"{path}: has {channels} channels, expected 1, 3 or 4; save it as grey or RGB."
        )
    if abs(width - 2 * height) > 2 * height * ASPECT:
        raise ValueError(
            f"{path}: is {width}x{height}, expected twice as wide as high; "
            f"convert it to an equirectangular panorama of the whole sphere."
        )
    texels = _repaired(texels[..., : min(channels, 3)], path)
    radiance = texels[..., 0] if channels == 1 else colour.luminance(texels)
    if not radiance.any():
        raise ValueError(f"{path}: is black everywhere, expected some light; use another map.")
    return np.ascontiguousarray(radiance, np.float32)


def _repaired(texels: np.ndarray, path: str | Path) -> np.ndarray:
    """Replaces what is no radiance, by the rule that `load` states."""
    overflowed = np.isposinf(texels)
    invalid = ~(texels >= 0)  # NaN compares false
    count = int((overflowed | invalid).any(-1).sum())
    if not count:
        return texels
    warnings.warn(
        f"{path}: repaired {count} texels that were negative or not finite.", stacklevel=3
    )
    largest = np.where(overflowed | invalid, 0, texels).max()
    return np.where(overflowed, largest, np.where(invalid, 0, texels))


def resized(radiance: np.ndarray, height: int) -> np.ndarray:
    """Averages a map over the texels of a smaller one.

    Args:
        radiance: `(H, W)` map, W about 2 H.
        height: Rows of the new map, at most H.

    Returns:
        `(height, 2 * height)` float32 with the same integral over the sphere.

    Raises:
        ValueError: If the new map would be larger.
    """
    rows, columns = radiance.shape
    if height > rows or 2 * height > columns:
        raise ValueError(
            f"a map of {columns}x{rows} cannot be averaged to {2 * height}x{height}, which is "
            f"larger; ask for at most {min(rows, columns // 2)} rows."
        )
    zenith = np.cos(np.linspace(0, np.pi, rows + 1))
    rings = _averaged(radiance, -zenith, -np.cos(np.linspace(0, np.pi, height + 1)))
    edges = np.linspace(0, 1, 2 * height + 1)
    texels = _averaged(rings.T, np.linspace(0, 1, columns + 1), edges).T
    return np.ascontiguousarray(texels, np.float32)


def _averaged(values: np.ndarray, edges: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """Means over the rows between `coarse` edges of values that are constant between `edges`."""
    means = np.empty((len(coarse) - 1, values.shape[1]))
    for k, (low, high) in enumerate(pairwise(coarse)):
        first = max(np.searchsorted(edges, low, "right") - 1, 0)
        last = max(np.searchsorted(edges, high, "left"), first + 1)
        overlap = np.diff(np.clip(edges[first : last + 1], low, high))
        means[k] = overlap @ values[first:last].astype(float) / (high - low)
    return means
