"""Reading and writing of pictures, with OpenImageIO."""

import io
import mmap
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import OpenImageIO as oiio

from lime_keras.io import atomic, untrusted
from lime_keras.optics import colour

if TYPE_CHECKING:
    from PIL import Image

LARGEST = 50_000_000
"""Largest number of pixels that a photo may have."""
FULL = 25_000_000
"""Largest number of pixels of a photo that is read at its full size.

An estimate takes some 100 bytes a pixel. A larger photo is read at half its width and height.
"""
SMALLEST = 16
"""Smallest number of pixels on a photo's shorter side; fewer show no object's shading."""
_LONGEST = 256
"""Largest ratio of a photo's sides; the networks would see a longer one less than a pixel wide."""
_HEIF = (".heic", ".heif", ".hif")
_LINEAR_FORMATS = ("openexr", "hdr")
_LINEAR_SPACES = ("lin", "scene_linear")
_MARKER = re.compile(rb"\xff[^\x00\x01\xd0-\xd7\xff]", re.DOTALL)
"""A marker of a JPEG that begins a segment or ends the picture; escaped bytes are none."""
_END_OF_IMAGE = 0xD9
_BAND = 256
"""Rows of a picture that are converted at a time."""


def read(path: str | Path) -> tuple[np.ndarray, np.ndarray | None]:
    """Read a photo of any kind, and its alpha channel if a part of the photo is transparent.

    Integer formats count as sRGB; with a colour profile, such as the Display P3 of phones, they are
    converted from it to sRGB. OpenEXR, Radiance and files marked as linear (a PNG with gamma 1) are
    linear: they are clipped at 1 and encoded as sRGB. A grey channel is repeated, palettes and CMYK
    become RGB, EXIF rotation is applied, and of a file with several pages the first is read.
    Transparent pixels are composed over black. A photo of more than `FULL` pixels is read at half
    its width and height, or a smaller whole part of them, averaged in linear light; a UserWarning
    tells it.

    Returns:
        image: `(H, W, 3)` float32 sRGB in [0, 1].
        alpha: `(H, W, 1)` float32 in [0, 1]; None if nothing is transparent.

    Raises:
        ValueError: if the file is missing, not a picture, empty, or holds NaN or infinity; also if
            it is smaller than `SMALLEST` or larger than `LARGEST`, cut short, or whatever its
            decoder raises.
        MemoryError: if it does not fit into memory; the message names it, too.
    """
    path = Path(path)
    picture = _opened(path)
    factor = _factor(picture.height, picture.width)
    image, alpha = _read(path, picture, factor)
    if factor > 1:
        warnings.warn(
            f"{path} has {picture.width}×{picture.height} pixels, more than the "
            f"{FULL // 10**6} million that are worked on at full size: it is read at "
            f"{image.shape[1]}×{image.shape[0]}, and so are its layers",
            stacklevel=2,
        )
    return image, alpha


def from_pil(image: "Image.Image") -> tuple[np.ndarray, np.ndarray | None]:
    """Return the pixels of a PIL image as `read` returns those of a file.

    EXIF rotation and a colour profile that the image brings are applied.

    Args:
        image: image of 8 bits a channel, of any mode.

    Raises:
        ValueError: if the image is empty, or has a mode of more bits, whose range is not known.
    """
    from PIL import ImageOps

    if image.mode.startswith(("I", "F")):
        raise ValueError(
            f"a PIL image of mode {image.mode} has no known range: pass its path, or an array of "
            "floats in [0, 1]"
        )
    if 0 in image.size:
        raise ValueError("a PIL image without pixels shows nothing: check how it was made")
    image = ImageOps.exif_transpose(image)
    profile, transparent = image.info.get("icc_profile"), image.has_transparency_data
    levels = np.asarray(image.convert("RGBA" if transparent else "RGB"), np.float32)
    pixels, alpha = levels[..., :3] / np.float32(255), levels[..., 3:] / np.float32(255)
    pixels = _conversion(profile)(pixels)
    if not transparent or np.min(alpha) == 1:
        return pixels, None
    return pixels * alpha, alpha


def read_srgb(path: str | Path) -> np.ndarray:
    """Read a photo as `(H, W, 3)` float32 sRGB in [0, 1], without its alpha channel.

    Raises:
        ValueError: if the photo cannot be read (see `read`).
    """
    return read(path)[0]


def read_mask(path: str | Path, height: int, width: int) -> np.ndarray:
    """Read the mask of an object from a picture that is white where the object is.

    The mask is the mean of the picture's channels, or its alpha channel if it has one.

    Args:
        path: path of the picture.
        height: height of the mask's photo in pixels.
        width: width of the mask's photo in pixels.

    Returns:
        Coverage `(height, width, 1)` float32 in [0, 1].

    Raises:
        ValueError: if the picture cannot be read (see `read`), has another size than the photo, or
            is black.
    """
    mask = read_coverage(path, height, width)
    if not np.any(mask >= 0.5):
        raise ValueError(f"{path} is black, so it masks no object: paint the object white")
    return mask


def read_coverage(path: str | Path, height: int, width: int) -> np.ndarray:
    """Read a mask as `read_mask` does; a black picture, in which no object was found, is taken.

    Raises:
        ValueError: if the picture cannot be read (see `read`) or has another size than the photo.
    """
    path = Path(path)
    picture = _opened(path)
    is_full = (picture.height, picture.width) == (height, width)
    factor = 1 if is_full else _factor(picture.height, picture.width)
    image, alpha = _read(path, picture, factor)
    mask = image.mean(-1, keepdims=True) if alpha is None else alpha
    if mask.shape[:2] != (height, width):
        raise ValueError(
            f"{path} has {mask.shape[1]}×{mask.shape[0]} pixels and its photo {width}×{height}: "
            "a mask has its photo's size"
        )
    return mask


def read_radiance(path: str | Path, height: int, width: int) -> np.ndarray:
    """Read a grey layer of linear radiance from an OpenEXR file of one channel.

    Args:
        path: path of the file.
        height: height of the layer's photo in pixels.
        width: width of the layer's photo in pixels.

    Returns:
        Linear radiance `(height, width, 1)` float32, the numbers of the file: at least 0, without
        an upper limit.

    Raises:
        ValueError: if the file cannot be read (see `read`), is no OpenEXR, has several channels or
            another size than the photo, or holds numbers that are negative or not finite.
    """
    path = Path(path)
    picture = _opened(path)
    if not picture.is_linear:
        raise ValueError(f"{path} is no OpenEXR: write linear radiance as one")
    if (picture.height, picture.width) != (height, width):
        raise ValueError(
            f"{path} has {picture.width}×{picture.height} pixels and its photo {width}×{height}: "
            "a layer has its photo's size"
        )
    with untrusted.naming(path, "a picture"):
        values = picture.rows(0, height)
    if values.shape[-1] != 1:
        raise ValueError(f"{path} has {values.shape[-1]} channels: a grey layer has one")
    if not np.isfinite(values).all():
        raise ValueError(f"{path} holds NaN or infinite pixels: repair or convert it")
    if np.min(values) < 0:
        raise ValueError(f"{path} holds {np.min(values):.3g}: radiance is at least 0, so clip it")
    return values


@dataclass(frozen=True)
class _Picture:
    """An opened picture, upright, in the numbers of its file.

    Attributes:
        height: height in pixels.
        width: width in pixels.
        rows: `rows(top, bottom)` returns float32 values `(bottom - top, W, C)`, 1 for the largest
            integer.
        alpha: index of the alpha channel; None without one.
        is_linear: whether the colours are linear.
        is_composed: whether they are multiplied by alpha already.
        to_srgb: conversion of colours `(h, W, 3)` from the picture's profile to sRGB.
    """

    height: int
    width: int
    rows: Callable[[int, int], np.ndarray]
    alpha: int | None
    is_linear: bool
    is_composed: bool
    to_srgb: Callable[[np.ndarray], np.ndarray]


def _opened(path: Path) -> _Picture:
    """Open and decode a picture, of whose size and kind nothing is known yet."""
    untrusted.check(path, "a picture")
    with untrusted.naming(path, "a picture"):
        return _open_heif(path) if path.suffix.lower() in _HEIF else _open(path)


def _open(path: Path) -> _Picture:
    image = oiio.ImageBuf(str(path))
    if not image.has_error:
        _check_size(path, image.spec().width, image.spec().height, image.spec().nchannels)
        if image.file_format_name == "jpeg":
            _check_end(path)
    # In the file's own numbers, which take a quarter of the memory of floats.
    if image.has_error or not image.read(force=True):
        raise ValueError(image.geterror())
    # Take the format's properties now: the image that `reorient` makes has lost them.
    space = image.spec().get_string_attribute("oiio:ColorSpace").lower()
    is_linear = image.file_format_name in _LINEAR_FORMATS or space.startswith(_LINEAR_SPACES)
    profile = image.spec().getattribute("ICCProfile")
    alpha, channels = image.spec().alpha_channel, image.spec().nchannels
    if 1 < image.orientation <= 8:  # some cameras write 0
        image = oiio.ImageBufAlgo.reorient(image)
    area = image.roi
    if area.width * area.height == 0:
        raise ValueError("it holds no pixels")

    def rows(top: int, bottom: int) -> np.ndarray:
        across = (area.xbegin, area.xend, area.ybegin + top, area.ybegin + bottom)
        values = image.get_pixels(oiio.FLOAT, oiio.ROI(*across))
        if values is None:
            raise ValueError(image.geterror())
        return values.reshape(bottom - top, area.width, -1)

    converts = profile is not None and not is_linear and channels >= 3
    return _Picture(
        area.height,
        area.width,
        rows,
        alpha if 0 < alpha < channels else None,
        is_linear,
        is_composed=True,
        to_srgb=_conversion(bytes(profile) if converts else None),
    )


def _open_heif(path: Path) -> _Picture:
    """Open a phone's HEIC as `_open` does; the wheels of OpenImageIO do not support HEIC."""
    import pillow_heif

    # The image is upright already: the library applies the file's rotation.
    image = pillow_heif.open_heif(path)
    width, height = image.size
    _check_size(path, width, height, channels=4)
    levels = np.asarray(image)
    levels = levels.reshape(*levels.shape[:2], -1)
    most, channels = np.float32(np.iinfo(levels.dtype).max), levels.shape[-1]
    return _Picture(
        len(levels),
        levels.shape[1],
        lambda top, bottom: levels[top:bottom] / most,
        alpha=3 if channels == 4 else None,
        is_linear=False,
        is_composed=False,
        to_srgb=_conversion(image.info.get("icc_profile") if channels >= 3 else None),
    )


def _read(path: Path, picture: _Picture, factor: int) -> tuple[np.ndarray, np.ndarray | None]:
    """Return sRGB `(H, W, 3)` in [0, 1], and alpha `(H, W, 1)` or None, as `read` does.

    The picture is converted in bands of rows, so that its floats are in memory only once.

    Args:
        path: path of the picture, for the messages.
        picture: the opened picture.
        factor: width and height in pixels of the areas that are averaged to a pixel.
    """
    height, width = -(-picture.height // factor), -(-picture.width // factor)
    with untrusted.naming(path, "a picture"):
        image = np.empty((height, width, 3), np.float32)
        alpha = None if picture.alpha is None else np.empty((height, width, 1), np.float32)
        for top in range(0, height, _BAND):
            first, last = top * factor, min((top + _BAND) * factor, picture.height)
            colours, opacity = _converted(picture, picture.rows(first, last))
            if not (np.isfinite(colours).all() and (opacity is None or np.isfinite(opacity).all())):
                raise ValueError(f"{path} holds NaN or infinite pixels: repair or convert it")
            colours = np.clip(colours, 0, 1)
            if factor > 1:
                mean = _averaged(colour.srgb_to_linear(colours), factor)
                colours = np.clip(colour.linear_to_srgb(mean), 0, 1)
            image[top : top + _BAND] = colours
            if alpha is not None and opacity is not None:
                alpha[top : top + _BAND] = _averaged(np.clip(opacity, 0, 1), factor)
    return image, alpha if alpha is not None and np.min(alpha) < 1 else None


def _converted(picture: _Picture, values: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """Return sRGB `(h, W, 3)`, not clipped, and alpha `(h, W, 1)` or None, of rows of a file."""
    opacity = None if picture.alpha is None else values[..., picture.alpha : picture.alpha + 1]
    if values.shape[-1] < 3:
        colours = np.repeat(values[..., :1], 3, axis=-1)
    else:
        colours = picture.to_srgb(values[..., :3])
    if opacity is not None and not picture.is_composed:
        colours = colours * opacity
    if picture.is_linear and np.isfinite(colours).all():
        colours = colour.linear_to_srgb(np.clip(colours, 0, 1))
    return colours, opacity


def _averaged(values: np.ndarray, factor: int) -> np.ndarray:
    """Return the means of areas of `factor` × `factor` pixels; the last ones may be smaller."""
    for axis in (0, 1):
        first = np.arange(0, values.shape[axis], factor)
        count = np.diff(np.append(first, values.shape[axis]))
        shape = [1, 1, 1]
        shape[axis] = len(count)
        values = np.add.reduceat(values, first, axis) / count.reshape(shape).astype(np.float32)
    return values


def _factor(height: int, width: int) -> int:
    """Return the least whole number by which a photo is reduced to at most `FULL` pixels."""
    factor = 1
    while -(-height // factor) * -(-width // factor) > FULL:
        factor += 1
    return factor


def _conversion(profile: bytes | None) -> Callable[[np.ndarray], np.ndarray]:
    """Return the conversion of colours `(H, W, 3)` in [0, 1] from an ICC profile, with 8 bits.

    The colours stay unchanged if there is no profile, or it is broken, is not for RGB (OpenImageIO
    has converted CMYK to RGB already), or is sRGB itself.
    """
    if not profile:
        return lambda colours: colours
    from PIL import Image, ImageCms

    try:
        source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        is_srgb = "srgb" in ImageCms.getProfileDescription(source).lower()
        if is_srgb or source.profile.xcolor_space.strip() != "RGB":
            return lambda colours: colours
        transform = ImageCms.buildTransform(source, ImageCms.createProfile("sRGB"), "RGB", "RGB")
    except (OSError, ImageCms.PyCMSError):
        return lambda colours: colours

    def converted(colours: np.ndarray) -> np.ndarray:
        levels = (np.clip(colours, 0, 1) * 255 + 0.5).astype(np.uint8)
        image = ImageCms.applyTransform(Image.fromarray(levels), transform)
        return np.asarray(image) / np.float32(255)

    return converted


def _check_size(path: Path, width: int, height: int, channels: int) -> None:
    if min(width, height) < SMALLEST:
        raise ValueError(
            f"{path} has {width}×{height} pixels, too few to see an object in: pass a picture of "
            f"at least {SMALLEST} on each side"
        )
    if max(width, height) > _LONGEST * min(width, height):
        raise ValueError(
            f"{path} has {width}×{height} pixels, more than {_LONGEST} times as many one way as "
            "the other: cut out the object"
        )
    untrusted.check_size(path, width, height, channels, LARGEST)


def _check_end(path: Path) -> None:
    """Raise ValueError if a JPEG ends before its end marker; its decoder fills what is missing."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        place = 2
        while found := _MARKER.search(data, place):
            marker, place = data[found.start() + 1], found.end()
            if marker == _END_OF_IMAGE:
                return
            # A segment tells its length; after that of a scan, its data lead to the next marker.
            place += int.from_bytes(data[place : place + 2])
    raise ValueError(f"{path} cannot be read as a picture: it is cut short; copy it again")


def write(path: str | Path, image: np.ndarray, *, shared: bool = False) -> None:
    """Write an image `(H, W, C)` of floats, or of uint8, completely or not at all.

    The same image always gives the same bytes.

    Args:
        path: path of the file. A `.exr` holds half floats; any other format holds 8 bits of [0, 1].
        image: values to write as they are, without a change of colour space; NaN becomes 0 in a
            format of 8 bits; uint8 stands for 0 to 1 in steps of 1/255. Of four channels, of
            floats, the last is alpha, by which the others are multiplied, as `read` has them.
        shared: whether several processes may write `path` at once (see `atomic.replacing`).

    Raises:
        OSError: if the file cannot be written.
        ValueError: if the suffix is of no format that can be written.
    """
    path = Path(path)
    if path.suffix.lower() == ".exr":
        _write_exr(path, image, shared)
    else:
        atomic.write(path, _encoded(path, image), shared=shared)


def check_written(path: Path, written: Path) -> None:
    """Raise OSError if a picture that OpenImageIO has written cannot be read to its end.

    The library does not see that the last bytes of a file found no room.

    Args:
        path: path of the picture, for the message.
        written: path where it was written.
    """
    picture = oiio.ImageBuf(str(written))
    if not picture.read(force=True):
        picture.geterror()  # fetched, as it would be printed otherwise
        raise OSError(
            f"{path} cannot be written: it ends too early; make room, or pass another folder"
        )


def _encoded(path: Path, image: np.ndarray) -> bytes:
    """Return the content of a file of 8 bits, in the format of the path's suffix."""
    from PIL import Image

    kind = Image.registered_extensions().get(path.suffix.lower())
    if kind is None:
        raise ValueError(f"{path} has no suffix of a picture: call it .png")
    if image.shape[-1] == 4 and image.dtype != np.uint8:
        image = _straight(image)
    levels = image if image.dtype == np.uint8 else _rounded(image)
    out = io.BytesIO()
    # Level 4 takes half the time of the default level, for a tenth more bytes.
    options = {"compress_level": 4} if kind == "PNG" else {}
    grey = levels.shape[-1] == 1
    picture = Image.fromarray(levels.reshape(levels.shape[:2]) if grey else levels)
    try:
        picture.save(out, kind, **options)
    except OSError as error:  # of an encoder that found no memory; no disk is written to here
        raise OSError(
            f"{path} cannot be written: {error}; if memory is short, close other programs"
        ) from error
    return out.getvalue()


def _straight(image: np.ndarray) -> np.ndarray:
    """Return `(H, W, 4)` with colours that are not multiplied by alpha, as a PNG has them."""
    colours, alpha = image[..., :3], image[..., 3:]
    divided = np.divide(colours, alpha, out=np.zeros_like(colours), where=alpha > 0)
    return np.concatenate([divided, alpha], axis=-1)


def _rounded(image: np.ndarray) -> np.ndarray:
    """Return the levels, uint8, of values `(H, W, C)` in [0, 1]; NaN becomes 0."""
    levels = np.empty(image.shape, np.uint8)
    # In bands: floats of the whole picture would take four times its memory.
    for top in range(0, len(image), _BAND):
        band = np.nan_to_num(np.asarray(image[top : top + _BAND], np.float32), nan=0)
        levels[top : top + _BAND] = np.clip(band, 0, 1) * np.float32(255) + np.float32(0.5)
    return levels


def _write_exr(path: Path, image: np.ndarray, shared: bool) -> None:
    height, width, channels = image.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.HALF)
    spec.attribute("DateTime", "")  # else the time of writing is put in
    buffer = oiio.ImageBuf(spec)
    dtype = np.uint8 if image.dtype == np.uint8 else np.float32
    buffer.set_pixels(oiio.ROI(), np.ascontiguousarray(image, dtype))
    with atomic.replacing(path, shared=shared) as partial:
        if not buffer.write(str(partial)):
            reason = buffer.geterror().replace(str(partial), str(path)) or "no reason is given"
            raise OSError(f"{path} cannot be written: {reason}; make room, or pass another folder")
        check_written(path, partial)
