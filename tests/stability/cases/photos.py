"""Cases for extreme photos: read from files, and fitted to a network's square input."""

import functools
import itertools
import tempfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from lime_keras.estimate import framing
from lime_keras.eval.stability.photos import extreme_photos
from lime_keras.eval.stability.verdicts import Case, Outcome
from lime_keras.io import photo

from .. import srgb_standard
from ..precisions import NUMPY_SINGLE
from ..refusals import refusal

_SIDE = 16
# File name, number format, levels up to white, whether the numbers are linear radiance.
_FORMATS = {
    "8-bit PNG": ("photo.png", oiio.UINT8, 255, False),
    "16-bit PNG": ("photo.png", oiio.UINT16, 65535, False),
    "OpenEXR": ("photo.exr", oiio.FLOAT, None, True),
}
_UNSOUND = {"NaN": np.nan, "infinite": np.inf, "minus infinite": -np.inf}
_BEYOND = {"pixels of -5": -5.0, "pixels of 1e30": 1e30}


def cases() -> list[Case]:
    """Return the cases of reading and of fitting photos."""
    out = []
    for image, kind in itertools.product(extreme_photos(_SIDE), _FORMATS):
        measure = functools.partial(_read, extreme_photos(_SIDE)[image], kind)
        out.append(Case("photo read", f"{image}, {kind}", NUMPY_SINGLE.name, measure))
    for name, value in _UNSOUND.items():
        measure = functools.partial(_refused, value, "OpenEXR")
        out.append(Case("photo read", f"{name} pixel refused", NUMPY_SINGLE.name, measure))
    for name, value in _BEYOND.items():
        measure = functools.partial(_read, np.full((_SIDE, _SIDE, 3), value), "OpenEXR")
        out.append(Case("photo read", f"{name} clipped", NUMPY_SINGLE.name, measure))
    for image, size in itertools.product(extreme_photos(_SIDE), (4, 16, 40)):
        measure = functools.partial(_fitted, extreme_photos(_SIDE)[image], size)
        out.append(Case("photo fitted", f"{image}, 16 to {size}", NUMPY_SINGLE.name, measure))
    for shape in ((1, 1, 3), (1000, 1, 3), (3, 700, 3)):
        measure = functools.partial(_fitted, np.full(shape, 0.5), 32)
        name = f"{shape[0]} × {shape[1]} pixels of one level, to 32"
        out.append(Case("photo fitted", name, NUMPY_SINGLE.name, measure))
    return out


def _write(folder: str, image: np.ndarray, kind: str) -> Path:
    """Write an image to a file, rounded if the format has integers, and return its path."""
    name, number, _, _ = _FORMATS[kind]
    path = Path(folder) / name
    buffer = oiio.ImageBuf(oiio.ImageSpec(image.shape[1], image.shape[0], 3, number))
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(image, np.float32))
    if not buffer.write(str(path)):
        raise OSError(f"{path} cannot be written: {buffer.geterror()}")
    return path


def _read(image: np.ndarray, kind: str) -> Outcome:
    with tempfile.TemporaryDirectory() as folder:
        found = photo.read_srgb(_write(folder, image, kind))
    _, _, levels, is_linear = _FORMATS[kind]
    image = np.clip(NUMPY_SINGLE.rounded(image), 0, 1)
    if levels:
        # A value halfway between two levels may be rounded up or down.
        low, high = (np.round(image * levels + side) / levels for side in (-1e-3, 1e-3))
    else:
        low = high = srgb_standard.encoded(image) if is_linear else image
    return Outcome(NUMPY_SINGLE.compare(found, low, high, np.maximum(high, is_linear * 0.055)))


def _refused(value: float, kind: str) -> Outcome:
    image = np.full((_SIDE, _SIDE, 3), 0.5)
    image[3, 4, 1] = value
    with tempfile.TemporaryDirectory() as folder:
        path = _write(folder, image, kind)
        outcome = refusal(lambda: photo.read_srgb(path), path.name, "NaN or infinite", "repair")
        return Outcome(note=outcome.note.replace(f"{folder}/", ""))


def _fitted(image: np.ndarray, size: int) -> Outcome:
    """Try a photo fitted to a square of `size` pixels.

    Reduced by a whole factor, each pixel must be the mean of its area in linear light. In the other
    cases the result must lie between the photo's least and greatest value.
    """
    image = NUMPY_SINGLE.rounded(image)
    found = framing.cut(image.astype(np.float32), framing.whole(*image.shape[:2]), size)
    low, high = np.full((size, size, 3), image.min()), np.full((size, size, 3), image.max())
    if size <= len(image) == image.shape[1]:
        factor = len(image) // size
        blocks = srgb_standard.decoded(image).reshape(size, factor, size, factor, 3)
        low = high = srgb_standard.encoded(blocks.mean((1, 3)))
    # sRGB decoding and encoding have condition numbers of 2.4 and 1 / 2.4, and a linear dark end.
    return Outcome(NUMPY_SINGLE.compare(found, low, high, 3 * high + 0.055, terms=(16 // 4) ** 2))
