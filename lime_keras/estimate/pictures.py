"""The forms in which a photo or a mask may be given: a file, its bytes, a PIL image, an array."""

import os
import tempfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from PIL import Image

from lime_keras.io import photo

_RANGE = (
    "values are finite and in [0, 1]: divide 8-bit ones by 255 and 16-bit ones by 65535, or pass "
    "8-bit ones as uint8"
)

Picture = str | os.PathLike[str] | bytes | IO[bytes] | np.ndarray | Image.Image | photo.Photo
"""A photo or a mask in one of the forms that `photo_of` and `mask_of` take."""


def photo_of(picture: Any) -> photo.Photo:
    """Return a photo as an array, its alpha channel if that masks a part of it, and cautions.

    Args:
        picture: path of a file (`photo.read`), its bytes, or an open binary file; PIL image
            (`photo.load_pil`); what `photo.load` has read; uint8 array `(H, W, 3)`, sRGB; or array
            of floats `(H, W, 3)`, sRGB in [0, 1].

    Returns:
        image: `(H, W, 3)` float32, sRGB in [0, 1].
        alpha: `(H, W, 1)` float32 in [0, 1]; None if it masks nothing, and for an array.
        cautions: what may be wrong with the photo as it was read.

    Raises:
        ValueError: if the file or the PIL image cannot be read, or the array has another shape, is
            not finite, or leaves [0, 1].
    """
    read = _read(picture)
    if read is not None:
        return read
    image = _floats(picture)
    if image.ndim != 3 or image.shape[-1] != 3 or image.size == 0:
        raise ValueError(
            f"a photo has shape (H, W, 3), got {image.shape}: repeat a grey channel three times; "
            "of RGBA pass a PIL image, or the alpha channel as the mask"
        )
    _check_range(image, "photo")
    return photo.Photo(image, None)


def mask_of(picture: Any, height: int, width: int) -> np.ndarray:
    """Return a mask as an array.

    Args:
        picture: path of a file (`photo.read_mask`), PIL image, array of bools, uint8 array of 0 to
            255, or array of floats in [0, 1]; an array is `(H, W)` or `(H, W, 1)`.
        height: height of the mask's photo in pixels.
        width: width of the mask's photo in pixels.

    Returns:
        Coverage `(height, width, 1)` float32 in [0, 1].

    Raises:
        ValueError: if the mask cannot be read, has another size than the photo, is not finite, or
            leaves [0, 1].
    """
    if isinstance(picture, str | os.PathLike):
        return photo.read_mask(picture, height, width)
    read = _read(picture)
    if read is None:
        mask = _floats(picture)
    else:
        image, alpha, _ = read
        mask = image.mean(-1) if alpha is None else alpha
    in_levels = read is not None or np.asarray(picture).dtype == np.uint8
    if in_levels and 0 < mask.max(initial=0) <= 1 / 255:
        raise ValueError(
            "a mask of 8 bits is 255 where the object is, and this one is at most 1: pass it as an "
            "array of bool"
        )
    if mask.shape not in ((height, width), (height, width, 1)):
        raise ValueError(
            f"a mask has its photo's shape, {(height, width)} or {(height, width, 1)}, got "
            f"{mask.shape}"
        )
    _check_range(mask, "mask")
    return mask.reshape(height, width, 1)


def _read(picture: Any) -> photo.Photo | None:
    """Return what is read of a file or PIL image; None for what is an array."""
    if isinstance(picture, photo.Photo):
        return picture
    if isinstance(picture, str | os.PathLike):
        return photo.load(picture)
    if isinstance(picture, bytes | bytearray | memoryview) or hasattr(picture, "read"):
        return _read_bytes(picture.read() if hasattr(picture, "read") else bytes(picture))
    return photo.load_pil(picture) if isinstance(picture, Image.Image) else None


def _read_bytes(content: bytes) -> photo.Photo:
    """Return what is read of a file's content, as `photo.load` does."""
    if not isinstance(content, bytes) or not content:
        raise ValueError("the file is empty, or open as text: open it in binary mode, 'rb'")
    with tempfile.TemporaryDirectory(prefix="lime-") as folder:
        path = Path(folder) / "picture"
        path.write_bytes(content)
        try:
            return photo.load(path)
        except ValueError as error:
            raise ValueError(str(error).replace(str(path), "the picture's bytes")) from error


def _floats(values: Any) -> np.ndarray:
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different lengths
        array = np.asarray(None)
    if array.dtype.kind not in "biuf":
        raise ValueError(
            f"a photo or a mask is a path, a PIL image or an array of numbers, got {type(values)}"
        )
    if array.dtype == np.uint8:
        return array / np.float32(255)
    if array.dtype == np.uint16:
        # Whether 8, 10, 12 or 16 bits of it are used cannot be seen.
        raise ValueError(f"values of uint16 have no known range; {_RANGE}")
    return np.asarray(array, np.float32)


def _check_range(values: np.ndarray, what: str) -> None:
    if not np.all((values >= 0) & (values <= 1)):
        raise ValueError(f"a {what}'s {_RANGE}")
