"""Environment maps: reading them from files, and reducing their size without losing light.

A map is `(H, W)` float32 radiance of one channel, W about 2 H, equirectangular: rows are equal
steps of the polar angle from the zenith, columns equal steps of the azimuth. When a map is reduced,
every new texel is the mean of the radiance it covers, weighted by solid angle. So the integral over
the sphere stays the same, wherever the light is.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lime_keras.io import colour_space, picture_file, untrusted
from lime_keras.optics import colour

EXTENSIONS = (".hdr", ".exr")

ASPECT = 0.02  # largest relative difference between W and 2 H
LARGEST = 2**27
"""Largest number of texels of a map that is read: 16,384 × 8,192, which take 2 GB of memory."""
_BAND = 256  # rows converted to floats at a time


def read(path: str | Path) -> tuple[np.ndarray, tuple[str, ...]]:
    """Read an environment map as radiance of one channel, upright, and repair broken texels.

    Infinite texels (lights too bright for the file's half floats) become the largest finite value
    of the file; NaN and negative texels become 0. Where the display window of an OpenEXR file holds
    no data, the map is black.

    Args:
        path: An OpenEXR or Radiance file, linear, Rec. 709 unless it tells other chromaticities,
            about 2:1, of any orientation and at most `LARGEST` texels; of several layers the one
            that would be the photo (`lime_keras.io.photo.read`).

    Returns:
        The map, `(H, W)` float32, finite, non-negative: the luminance of the colour channels, in
        the file's unit and size; and notes on what was repaired.

    Raises:
        ValueError: If the file is missing or cannot be read, or if its shape is wrong,
            its channels are not those of one picture, or if it is black everywhere.
    """
    path = Path(path)
    untrusted.check(path, "an environment map")
    with untrusted.naming(path, "an environment map"):
        return _read(path)


def _read(path: Path) -> tuple[np.ndarray, tuple[str, ...]]:
    # Open: kind, size and layout of the file.
    image = picture_file.open_image(path)
    if image.file_format_name not in ("openexr", "hdr"):
        raise ValueError(
            f"{path}: is a {image.file_format_name.upper()} file by its content, whose numbers are "
            "no radiance; use the OpenEXR or Radiance HDR original."
        )
    channels, names = [0, 1, 2], image.spec().channelnames
    if {*names} == {*"XYZ"}:
        channels = [names.index("Y")]  # the luminance of CIE XYZ
    elif image.file_format_name == "openexr":
        image, channels, _ = picture_file.by_name(path, image)
    spec, window = image.spec(), image.roi_full
    for area in (spec, window):
        untrusted.check_size(path, area.width, area.height, spec.nchannels, LARGEST)
    orientation = image.orientation if 1 < image.orientation <= 8 else 1
    height, width = (window.height, window.width)[:: 1 if orientation < 5 else -1]
    if abs(width - 2 * height) > 2 * height * ASPECT:
        raise ValueError(
            f"{path}: is {width}x{height}, expected twice as wide as high; "
            f"convert it to an equirectangular panorama of the whole sphere."
        )
    # Repair: what is not a number of light takes the largest that is.
    largest, broken = 0.0, 0
    for texels in _bands(image, channels):
        sound = np.isfinite(texels) & (texels >= 0)
        largest = max(largest, float(texels.max(where=sound, initial=0)))
        broken += int(np.sum(~sound.all(-1)))
    weights = np.ones(1, np.float32)
    if len(channels) == 3:
        primaries = picture_file.chromaticities(path, image)
        weights = colour.LUMINANCE_WEIGHTS
        if primaries:
            weights = (weights @ colour_space.matrix(primaries)).astype(np.float32)
    # Colours beyond those of the film may sum up to less than nothing.
    radiance = np.concatenate(
        [np.maximum(_repaired(band, largest) @ weights, 0) for band in _bands(image, channels)]
    )
    if not radiance.any():
        raise ValueError(f"{path}: is black everywhere, expected some light; use another map.")
    # Note what was left out.
    notes = []
    if broken:
        notes.append(f"repaired {broken} texels that were negative or not finite")
    covered = oiio.intersection(spec.roi, window)
    absent = 1 - max(covered.width, 0) * max(covered.height, 0) / (window.width * window.height)
    if absent > 0:
        notes.append(f"{absent:.0%} of its display window holds no data: black")
    if spec.nchannels > 4:
        used = ", ".join(spec.channelnames[index] for index in channels)
        notes.append(f"of {spec.nchannels} channels, {used} are used")
    return _upright(radiance, orientation), tuple(notes)


def _bands(image: oiio.ImageBuf, channels: list[int]) -> Iterator[np.ndarray]:
    """Yield the display window's texels in `(h, W, C)` bands, to save memory with large maps."""
    window = image.roi_full
    for top in range(window.ybegin, window.yend, _BAND):
        bottom = min(top + _BAND, window.yend)
        texels = image.get_pixels(oiio.FLOAT, oiio.ROI(window.xbegin, window.xend, top, bottom))
        if texels is None or image.has_error:
            raise ValueError(f"{image.geterror().strip()}; copy it again, or export it anew")
        yield texels[..., channels]


def _repaired(texels: np.ndarray, largest: float) -> np.ndarray:
    """Replace values that are no radiance; `read` states the rule."""
    sound = np.where(texels > 0, texels, 0)  # NaN compares false
    return np.where(np.isposinf(texels), np.float32(largest), sound)


def _upright(radiance: np.ndarray, orientation: int) -> np.ndarray:
    """Turn and mirror a map `(H, W)` according to its file's orientation, 1 to 8."""
    if orientation == 1:
        return radiance
    image = oiio.ImageBuf(np.ascontiguousarray(radiance[..., None]))
    image.orientation = orientation
    return np.asarray(oiio.ImageBufAlgo.reorient(image).get_pixels(oiio.FLOAT))[..., 0]


def resized(radiance: np.ndarray, height: int) -> np.ndarray:
    """Average a map over the texels of a smaller map.

    Args:
        radiance: `(H, W)` map, W about 2 H.
        height: Rows of the new map, at most H and at most W / 2.

    Returns:
        `(height, 2 * height)` float64 with the same integral over the sphere.
    """
    rows, columns = radiance.shape
    zenith = np.cos(np.linspace(0, np.pi, rows + 1))
    rings = _averaged(radiance, -zenith, -np.cos(np.linspace(0, np.pi, height + 1)))
    edges = np.linspace(0, 1, 2 * height + 1)
    return _averaged(rings.T, np.linspace(0, 1, columns + 1), edges).T


def _averaged(values: np.ndarray, edges: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """Return the means `(K, C)` of values `(R, C)` over new rows.

    Row k is constant between `edges[k]` and `edges[k + 1]`, `(R + 1,)`, ascending. The borders of
    the new rows, `(K + 1,)`, are every R/K-th of `edges` where that is a whole number.
    """
    count, folds = len(coarse) - 1, len(values) // (len(coarse) - 1)
    if folds * count == len(values):  # `folds` whole rows in each new one
        weights = np.diff(edges)[:, None]
        total = values[::folds] * weights[::folds]
        for fold in range(1, folds):
            total += values[fold::folds] * weights[fold::folds]
        return total / np.diff(coarse)[:, None]
    # The integral from the first border to each; between borders it is linear.
    integral = np.zeros((len(edges), values.shape[1]))
    np.multiply(values, np.diff(edges)[:, None], out=integral[1:])
    np.cumsum(integral, axis=0, out=integral)
    row = np.clip(np.searchsorted(edges, coarse, "right") - 1, 0, len(values) - 1)
    with np.errstate(invalid="ignore"):  # the caller refuses what is not finite
        at_coarse = integral[row] + (coarse - edges[row])[:, None] * values[row]
        means = np.diff(at_coarse, axis=0) / np.diff(coarse)[:, None]
    return np.maximum(means, 0)  # differences of rounded sums
